"""How often a change is told, dated and sized, and how often one is told where there is none.

    python benchmarks/changes.py [--histories 100] [--logs 3]

Histories of 200 shifts of five readings with 1 % noise a shift; in one of them something moves by
3 % after shift 60: at once, over 60 shifts, or until the end. Without a change: another size of the
noise in each reading, one of which follows the temperature.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np

import picchio
from picchio.ledger.watch.changes import ALARMS, Reading, find

sys.path[:0] = [
    str(Path(__file__).resolve().parents[1] / part) for part in ("tests", "tests/ledger")
]

import shift  # noqa: E402
from test_changes import LOG_MAPPING, shift_log  # noqa: E402

DAY = 86_400 * 10**9
COUNT, BEGIN, SIZE, NOISE = 200, 60, -0.03, 0.01


def history(values, name, covariates=None):
    when = 1_772_352_000_000_000_000 + DAY * np.arange(len(values))
    none = np.empty((0, len(values))) if covariates is None else covariates
    return Reading(name, "stiffness_drift", name, when, values, none)


def moved(kind):
    index = np.arange(COUNT)
    if kind == "step":
        return SIZE * (index >= BEGIN)
    length = 60 if kind == "ramp over 60 shifts" else COUNT - BEGIN
    return SIZE * np.clip((index - BEGIN) / length, 0.0, 1.0)


SHIFTS, MOVED = 60, 40


def from_logs(count: int) -> None:
    """Histories as logs, through the whole of `count`; all follow the temperature."""
    robot = picchio.load_robot("fanuc_like_3dof")
    for kind, target in (("nothing", None), ("joint_2 4 % softer", "stiffness of joint_2"),
                         ("friction 20 % more", "friction of joint_"),
                         ("lost motion doubled", "lost motion of joint_")):  # fmt: skip
        right = dated = others = 0
        for seed in range(count):
            rng = np.random.default_rng([77, seed])
            with tempfile.TemporaryDirectory() as place:
                logs = Path(place) / "logs"
                logs.mkdir()
                (logs / "mapping.toml").write_text(LOG_MAPPING)
                for number in range(SHIFTS):
                    late = number >= MOVED
                    warm = 20.0 + 5.0 * np.sin(number / 8.0) + rng.standard_normal()
                    soft = np.full(3, 1.0 - 2e-3 * (warm - 20.0))
                    soft[1] *= 0.96 if late and "softer" in kind else 1.0
                    rub = (1.2 if late and "friction" in kind else 1.0) - 0.01 * (warm - 20.0)
                    gap = 2e-4 if late and "lost" in kind else 1e-4
                    shift_log(logs, number, rng, soft, rub, gap, warm)
                found = picchio.count(robot, logs, Path(place) / "ledger")
            mine = [c for c in found.changes if target and c["reading"].startswith(target)]
            others += len(found.changes) - len(mine)
            right += bool(mine)
            day = str(np.datetime64(shift.BEGIN + MOVED * DAY, "ns"))[:10]
            dated += any(c["since_low"] <= day <= c["since_high"] for c in mine)
        print(f"{count} histories of {SHIFTS} logs, {kind} after {MOVED}: told of {right}, dated "
              f"rightly {dated}, {others} other changes told", flush=True)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--histories", type=int, default=100)
    parser.add_argument("--logs", type=int, default=0, help="histories of each kind, as logs")
    asked = parser.parse_args()
    count = asked.histories
    if asked.logs:
        from_logs(asked.logs)
        return
    for kind in ("step", "ramp over 60 shifts", "ramp to the end"):
        found = dated = sized = others = 0
        for seed in range(count):
            rng = np.random.default_rng(seed)
            mine = history(NOISE * rng.standard_normal(COUNT) + np.log1p(moved(kind)), "mine")
            rest = [history(NOISE * rng.standard_normal(COUNT), f"r{k}") for k in range(4)]
            changes = find([mine, *rest])
            told = [c for c in changes if c.reading is mine]
            others += len(changes) - len(told)
            if told:
                found += 1
                dated += told[0].onset_low <= BEGIN <= told[0].onset_high
                sized += told[0].low <= SIZE <= told[0].high
        print(f"{kind}: {found} of {count} told; the onset's 90 % interval holds it in {dated}, "
              f"the size's in {sized}; {others} other readings told")  # fmt: skip
    alarms = 0
    for seed in range(count):
        rng = np.random.default_rng(10_000 + seed)
        readings = [
            history(size * rng.standard_normal(COUNT), f"r{k}")
            for k, size in enumerate((0.003, 0.01, 0.02, 0.05))
        ]
        warmth = 20.0 + 5.0 * np.sin(np.arange(COUNT) / 20.0) + rng.standard_normal(COUNT)
        values = -1e-3 * warmth + NOISE * rng.standard_normal(COUNT)
        readings.append(history(values, "warm", warmth[None]))
        alarms += bool(find(readings))
    print(f"nothing changed: {alarms} of {count} told (set: {100 * ALARMS:g} %)")


if __name__ == "__main__":
    main()
