"""How often a change is told, dated and sized, and how often one is told where there is none.

    python benchmarks/changes.py [--histories 100]

Histories of 200 shifts of five readings with 1 % noise a shift; in one of them something moves by
3 % after shift 60: at once, over 60 shifts, or until the end. Without a change: another size of the
noise in each reading, one of which follows the temperature.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from picchio.ledger.changes import ALARMS, Reading, find
from picchio.ledger.exchange import exchange

sys.path[:0] = [
    str(Path(__file__).resolve().parents[1] / part) for part in ("tests", "tests/ledger")
]

from test_changes import no_swaps, swapped  # noqa: E402

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


def swaps(count: int) -> None:
    """Fleets of four, of which two robots are swapped; histories in which none is."""
    told = right = dated = alarms = 0
    for seed in range(1000, 1000 + count):
        found, near, late = swapped(seed)
        alarms += sum(found[n] is not None for n in (2, 3))
        for a in (0, 1):
            told += found[a] is not None
            right += near[a] is not None and near[a][0] == 1 - a
            dated += late[a] is not None and abs(late[a]) <= 2
    print(f"{count} swaps of two robots in fleets of four: told of {told} of {2 * count} robots, "
          f"whose logs they are of {right}, within two shifts of {dated}; told of {alarms} of "
          f"{2 * count} others (set: {100 * ALARMS:g} %)")  # fmt: skip
    tally: dict[str, int] = {}
    for seed in range(1000, 1000 + count):
        for kind, readings in no_swaps(seed).items():
            tally[kind] = tally.get(kind, 0) + (exchange(readings) is not None)
    words = ", ".join(f"{kind}: {number}" for kind, number in tally.items())
    print(f"no swap, {count} histories each, told as one: {words}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--histories", type=int, default=100)
    count = parser.parse_args().histories
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
    swaps(count)
    print(f"nothing changed: {alarms} of {count} told (set: {100 * ALARMS:g} %)")


if __name__ == "__main__":
    main()
