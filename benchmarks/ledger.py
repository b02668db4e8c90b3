"""Whether a ledger's damage depends on how its logs came: cuts, order, repeats, faults, kills.

    python benchmarks/ledger.py [--splits 10000] [--kills 200]

Splits: in this process, each with a statement of the database failing at random in every log that
is added, which is then added again. Kills: `picchio.count` in a process of its own on a folder of
logs, killed (SIGKILL) after a random time, again and again, then let through.
"""

from __future__ import annotations

import argparse
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path[:0] = [
    str(Path(__file__).resolve().parents[1] / part) for part in ("tests", "tests/ledger")
]

import shift  # noqa: E402
import test_count as tests  # noqa: E402

import picchio  # noqa: E402
from picchio.campaign.importing.mapping import read_mapping  # noqa: E402
from picchio.core.errors import OutputError  # noqa: E402
from picchio.fatigue.sn.library import load_sn_curve  # noqa: E402
from picchio.ledger import count as counting  # noqa: E402
from picchio.ledger.samples import read_samples  # noqa: E402
from picchio.ledger.store import Ledger  # noqa: E402
from picchio.model.model import Model  # noqa: E402
from picchio.studies.rivet.life_rules import curves_of  # noqa: E402
from picchio.studies.tasks import load_task  # noqa: E402

CHILD = """import sys, picchio
robot = picchio.load_robot("fanuc_like_3dof")
print("ready", flush=True)
picchio.count(robot, sys.argv[1], sys.argv[2], sn_curve=sys.argv[3])"""


def splits(folder: Path, count: int, first: int) -> None:
    robot = picchio.load_robot(tests.NAME)
    task = load_task(robot.task_path, robot)
    rng = np.random.default_rng(5)
    made = shift.rivets(3, rng, apart=1.6, places=2)
    path = tests.folder(folder / "logs", made, rng, length=6.0)
    rules = read_mapping(path / "mapping.toml")
    (samples,) = read_samples(path / "part0.parquet", rules, robot)
    stream = counting.stream_of(samples, rules, task, robot)
    curves = curves_of(robot, load_sn_curve(str(folder / "curve.toml")))
    with Ledger(folder / "whole", tests.NAME) as book:
        book.add("log", "m", "log", stream, [samples])
        expected = counting.recount(book, Model.of(robot), curves, task).totals.damage
    worst, faults, begin = 0.0, 0, time.perf_counter()
    for trial in range(first, first + count):
        rng = np.random.default_rng(trial)
        file = folder / "cut"
        for name in (file, Path(f"{file}-wal"), Path(f"{file}-shm")):
            name.unlink(missing_ok=True)
        with Ledger(file, tests.NAME) as book:
            book._base.execute("PRAGMA synchronous = OFF")
            for number, (a, b) in enumerate(tests.cuts(samples, rng)):
                part, sound = samples.between(a, b), book._base
                book._base = tests.Faulty(sound, int(rng.integers(1, 14)))
                try:
                    book.add(str(number), "m", "part", stream, [part])
                except OutputError:
                    faults += 1
                book._base = sound
                book.add(str(number), "m", "part", stream, [part])
            found = counting.recount(book, Model.of(robot), curves, task).totals.damage
        worst = max(worst, float(np.abs(found / expected - 1.0).max()))
    print(f"{count} splits, repeats and orders with {faults} faults: the damage differs by "
          f"{worst:.3g} at most, relative ({time.perf_counter() - begin:.0f} s)")  # fmt: skip


def kills(folder: Path, count: int, asked: float) -> None:
    rng = np.random.default_rng(9)
    made = shift.rivets(6, rng, apart=1.6, places=2)
    path = tests.folder(folder / "many", made, rng, parts=24)
    curve = folder / "curve.toml"
    robot = picchio.load_robot(tests.NAME)
    whole = picchio.count(robot, path, folder / "all", sn_curve=str(curve)).counted.totals.damage
    ledger, killed, during, rounds, differ = folder / "killed", 0, 0, 0, 0.0
    added = 0
    while killed < count:
        ledger.unlink(missing_ok=True)
        rounds += 1
        for _ in range(12):
            child = subprocess.Popen([sys.executable, "-c", CHILD, path, ledger, curve],
                                     stdout=subprocess.PIPE)  # fmt: skip
            assert child.stdout is not None
            child.stdout.readline()
            time.sleep(rng.uniform(0.0, asked))
            during += child.poll() is None
            child.send_signal(signal.SIGKILL)
            child.wait()
            killed += 1
        with Ledger(ledger, tests.NAME) as book:
            added += len(book.logs())
        found = picchio.count(robot, path, ledger, sn_curve=str(curve)).counted.totals.damage
        differ = max(differ, float(np.abs(found / whole - 1.0).max()))
    print(
        f"{killed} kills, {during} of them while it ran, in {rounds} ledgers, which then held "
        f"{added / rounds:.3g} of 24 logs: the damage differs by {differ:.3g} at most, relative"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--splits", type=int, default=10_000)
    parser.add_argument("--first", type=int, default=0, help="the first split's seed")
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--within", type=float, default=1.5, help="s: a kill comes within these")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        if asked.splits:
            splits(Path(place), asked.splits, asked.first)
        if asked.kills:
            kills(Path(place), asked.kills, asked.within)


if __name__ == "__main__":
    main()
