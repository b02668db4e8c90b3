"""How long a diagnosis takes: data sets of 18 records of independent simulators, one after another.

    python benchmarks/diagnosis.py [--one-core] [--arms] [--wrong] [--json FILE]

Wall time with all cores of the whole command, `picchio diagnose ROBOT --data CAMPAIGN --json -`, as
a user gets it: its start, the records read, the verdict, and the life without and with the causes.
Effects alone, pairs, nothing wrong, as `blind_trial.py` draws them, at 40 dB on the 3-DoF arm.
`--one-core` adds the same on one core, in turns, and the ratio; `--arms` a single and a null on the
UR10 and the Kinova Gen3; `--wrong` takes worlds that are off by all tolerances in their place, a
six-joint arm and a force that is read among them. Nothing else should run meanwhile.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
# Not this folder, which has a rainflow.py of its own.
sys.path[0] = str(ROOT / "tests" / "diagnosis" / "blind")
import trial  # noqa: E402

from picchio.core.files import atomic_write  # noqa: E402

COMMAND = (sys.executable, "-P", "-c", "from picchio.cli.main import main; main()")
ARM, OTHERS = "fanuc_like_3dof", ("ur10", "kinova_gen3")
# An early draw of each, spread over what effects are: structure, contact, blows, sensors.
SINGLES = (
    "payload", "joint_stiffness", "cable", "backlash", "force_direction", "pulse_width",
    "sensor_delay",
)  # fmt: skip
PAIRS = (0, 8, 16, 24, 32, 40, 48)
SALT = 1
# Where all is a little wrong: robot, what is hidden, whether the force is read.
WRONG = (
    (ARM, None, False), (ARM, "force_amplitude", False), (ARM, "joint_stiffness", False),
    (ARM, None, True), (ARM, "payload", True), (ARM, "joint_stiffness", True),
    ("fanuc_r2000ic", None, False), ("fanuc_r2000ic", "payload", False),
    ("fanuc_r2000ic", "joint_stiffness", False),
)  # fmt: skip


def wrong() -> Iterator[dict[str, Any]]:
    for robot, effect, read in WRONG:
        kind = {"kind": "single", "effect": effect} if effect else {"kind": "null"}
        sensors = {"sensors": ["accelerometer", "deflection", "force"]} if read else {}
        yield {"robot": robot, "snr": 40, "draw": 90001, "mismatch": 1, **kind, **sensors}


def cases(arms: bool) -> Iterator[dict[str, Any]]:
    common = {"robot": ARM, "snr": 40}
    for effect in SINGLES:
        yield {**common, "kind": "single", "effect": effect, "draw": 1}
    for draw in PAIRS:
        yield {**common, "kind": "pair", "draw": draw}
    for draw in range(3):
        yield {**common, "kind": "null", "draw": draw}
    for robot in OTHERS if arms else ():
        for kind in ("single", "null"):
            yield {**common, "robot": robot, "kind": kind, "draw": 0}


def timed(case: dict[str, Any], one_core: bool = False) -> tuple[float, str, bool]:
    """(s, verdict, whether it is right) of the command, its start included."""
    campaign, truth = trial.make(case, SALT)
    with tempfile.TemporaryDirectory() as name:
        folder = campaign.save(Path(name) / "campaign").folder
        began = time.perf_counter()
        done = subprocess.run(
            [*COMMAND, "diagnose", case["robot"], "--data", str(folder), "--json", "-"],
            capture_output=True, text=True, check=False,
            preexec_fn=(lambda: os.sched_setaffinity(0, {0})) if one_core else None,
        )  # fmt: skip
        took = time.perf_counter() - began
    if done.returncode != 0:
        raise SystemExit(f"{trial.name_of(case)} failed: {done.stderr}")
    said = json.loads(done.stdout)
    sets = [{(c["effect"], c["target"]) for c in each}
            for each in (said["causes"], *said["alternatives"])]  # fmt: skip
    true = {(c["effect"], c["target"]) for c in truth["causes"]}
    return took, said["verdict"], true in sets


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--one-core", action="store_true", help="the same on one core, too")
    parser.add_argument("--arms", action="store_true", help="the UR10 and the Gen3, too")
    parser.add_argument("--wrong", action="store_true", help="all a little wrong, in their place")
    parser.add_argument("--json", type=Path, help="write the figures here")
    given = parser.parse_args()
    timed({"robot": ARM, "kind": "null", "snr": 40, "draw": 10**6})  # compiles, or loads
    rows = []
    print(f"{'case':76} {'s':>6}" + (f" {'one core':>9} {'ratio':>6}" if given.one_core else ""))
    for case in wrong() if given.wrong else cases(given.arms):
        took, verdict, right = timed(case)
        row = {"case": trial.name_of(case), "kind": case["kind"], "robot": case["robot"]}
        row |= {"seconds": took, "verdict": verdict, "right": right}
        line = f"{row['case']:76} {took:6.1f}"
        if given.one_core:
            row["one_core_seconds"] = timed(case, one_core=True)[0]
            line += f" {row['one_core_seconds']:9.1f} {row['one_core_seconds'] / took:6.2f}"
        rows.append(row)
        print(line, f" {verdict}" + ("" if right else " (wrong)"), flush=True)
    for kind in ("single", "pair", "null"):
        seconds = [r["seconds"] for r in rows if r["kind"] == kind and r["robot"] == ARM]
        if seconds:
            print(f"{kind}: median {median(seconds):.1f} s, longest {max(seconds):.1f} s")
    if given.json:
        with atomic_write(given.json) as stream:
            json.dump({"cores": os.cpu_count(), "cases": rows}, stream, indent=1)


if __name__ == "__main__":
    main()
