"""Whenever a command is asked to end, it does: one line, 130 or 143, soon, nothing left behind."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import pytest
from faults import ARM, inputs
from held import alive, children

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks at Linux's /proc")

# Name: (what is typed, what it may leave: work that is found again when it goes on).
COMMANDS = {
    "robots": "robots",
    "effects": "effects",
    "annotate": f"annotate {ARM} --out r.urdf",
    "start": "start ur10 --out new",
    "fit-sn": "fit-sn tests.csv --out steel.toml --plot steel.png",
    "assess": f"assess {ARM} --uncertainty --report a.html --json a.json",
    "envelope": f"envelope {ARM} --pose 0,0.5,-0.8 --json e.json",
    "map": f"map {ARM} --joint-grid 200 --workers 1 --out m.nc",
    "map-zarr": f"map {ARM} --joint-grid 200 --workers 2 --out m.zarr",
    "map-damage": f"map {ARM} --joint-grid 12 --damage --workers 2 --out d.nc",
    "place": f"place {ARM} --out p.toml --json p.json",
    "compare": f"compare {ARM} ur10 --report c.html",
    "view": f"view {ARM} --out v.html",
    "explore": f"explore {ARM}",
    "check": f"check campaign --robot {ARM} --report q.html --json q.json",
    "import": "import raw.csv --mapping made.toml --to imported",
    "simulate": f"simulate {ARM} --plan plan.toml --to simulated",
    "diagnose": f"diagnose {ARM} --data campaign --model d.toml --json d.json --report d.html",
    "identify": f"identify {ARM} --data campaign --out i.toml",
    "plan": f"plan {ARM} --budget 20min --with hammer,accelerometer --to sheet",
    "count": f"count {ARM} --log logs --ledger l.ledger --report l.html",
    "reproduce": "reproduce --report rep.html",
}
RESUMED = {".m.nc.chunks", ".m.zarr.chunks", ".d.nc.chunks"}
BOOKS = {"l.ledger"}  # kept once a log stands in them
MOMENTS = (0.0, 0.3, 1.0, 3.0)  # s; 0: as soon as it can be asked at all
SIGNALS = {signal.SIGINT: (130, "interrupted"), signal.SIGTERM: (143, "terminated")}
QUICK = ("map-zarr", "plan")
SOON = 1.0  # s


@pytest.fixture(scope="module")
def given(tmp_path_factory):
    folder = tmp_path_factory.mktemp("given")
    inputs(folder)
    (folder / "new").mkdir()
    joints = ("joint_1", "joint_2", "joint_3")
    head = ",".join(["time", "force", *joints])
    forces = [300.0 if i % 20 < 2 else 0.0 for i in range(60_000)]
    rows = "".join(f"{1.7e9 + 0.002 * i:.3f},{f},0,0.5,-0.8\n" for i, f in enumerate(forces))
    named = {"force": ("force", "N"), **{j: (f"position.{j}", "rad") for j in joints}}
    (folder / "logs").mkdir()
    (folder / "logs" / "a.csv").write_text(f"{head}\n{rows}")
    (folder / "logs" / "mapping.toml").write_text(
        'format = "picchio-mapping/1"\nsource.kind = "csv"\n'
        'time.series = "time"\ntime.unit = "s"\nblows.operation = "forward"\n'
        + "".join(
            f'[[channel]]\nfrom = "{name}"\nto = "{to}"\nunit = "{unit}"\n'
            for name, (to, unit) in named.items()
        )
    )
    return folder


def handled(process):
    """Whether its own code has begun: until then Python itself, starting, ends it."""
    text = Path(f"/proc/{process.pid}/status").read_text()
    caught = int(re.search(r"SigCgt:\s*(\w+)", text)[1], 16)
    return bool(caught >> (signal.SIGTERM - 1) & 1)


def ended(given, typed, number, moment):
    """Exit status, stderr, seconds it took, and what was left, in files and processes."""
    before = {str(p) for p in given.rglob("*")}
    words = [sys.executable, "-P", "-c", "from picchio.cli.main import main; main()"]
    temporary = given / "temporary"
    temporary.mkdir(exist_ok=True)
    process = subprocess.Popen(
        [*words, *typed.split()], cwd=given, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
        text=True, env=os.environ | {"TMPDIR": str(temporary)},
    )  # fmt: skip
    try:
        while not handled(process) and process.poll() is None:
            time.sleep(0.001)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(moment)
        workers = children(process.pid) if process.poll() is None else set()
        asked = time.monotonic()
        process.send_signal(number)
        _, said = process.communicate(timeout=60)
        took = time.monotonic() - asked
    finally:
        process.kill()
    left = {p for p in given.rglob("*") if str(p) not in before and p != temporary}
    return process.returncode, said, took, left, [pid for pid in workers if alive(pid)]


def cases():
    for name in COMMANDS:
        for number in SIGNALS:
            for moment in MOMENTS:
                quick = name in QUICK and number == signal.SIGTERM and moment >= 1.0
                yield pytest.param(name, number, moment, marks=[] if quick else pytest.mark.slow)


def holds_a_log(ledger):
    """Whether a ledger may stay: a log was counted into it, whole, before the end."""
    with contextlib.closing(sqlite3.connect(ledger)) as base:
        whole = base.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        return whole and bool(base.execute("SELECT id FROM log LIMIT 1").fetchall())


@pytest.mark.parametrize(("name", "number", "moment"), list(cases()))
def test_asked_to_end(given, name, number, moment):
    status, said, took, left, workers = ended(given, COMMANDS[name], number, moment)
    books = {p for p in left if p.name in BOOKS}
    beside = {p.with_name(p.name + end) for p in books for end in ("-wal", "-shm")}
    kept = {p for p in left if RESUMED & set(p.parts) or p in books | beside}
    try:
        if status == 0:  # it was done before
            return
        code, word = SIGNALS[number]
        wrote = {f"picchio: wrote {p.name}" for p in books}
        lines = [s for s in said.splitlines() if "warning" not in s and s not in wrote]
        assert (status, lines) == (code, [f"picchio: error: {word}"]), said
        assert took < SOON
        assert left == kept and not workers, (left, workers)
        assert all(holds_a_log(p) for p in books)
        assert all(list(p.glob("*.npz")) for p in kept if p.is_dir()), "an empty folder"
    finally:
        for path in sorted(left, reverse=True):
            path.rmdir() if path.is_dir() else path.unlink(missing_ok=True)  # SQLite tidies up


@pytest.mark.parametrize("number", list(SIGNALS))
@pytest.mark.parametrize("module", ["json", "picchio.cli.running"])
def test_what_fails_because_it_was_asked_to_end_ends(number, module):
    """A library that is interrupted in the midst of its import says that something is wrong."""
    asked = f"""
import sys, os, time
sys.modules.pop("json", None)
class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            try:
                os.kill(os.getpid(), {int(number)})
                time.sleep(5)
            except BaseException:
                pass
            raise RuntimeError("the schema is wrong")
sys.meta_path.insert(0, Finder())
from picchio.cli.main import main
main(["robots", "--json", "-"])
"""
    done = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True)
    code, word = SIGNALS[number]
    assert (done.returncode, done.stderr) == (code, f"picchio: error: {word}\n")
