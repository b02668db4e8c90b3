"""What placing the work gains, what a brute-force grid finds, and what both cost.

    python benchmarks/placement.py [--json FILE] [--only NAME]

The paper's 15-rivet panel on its 3-DoF arm, and panels of six rivets on a UR10 and a Panda, whose
shafts are assumed, so that there is a life. Lives by the paper's S-N curve, under which every
stress does damage; the 3-DoF arm also by its steel, under which no life has an end and utilisation
ranks. The grid is a plain loop over `all_branches` and `assess` (tests/studies/placement_grid.py).
Searches and grid are both timed on one core, with kernels compiled.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import numba

import picchio
from picchio.core.files import atomic_write
from picchio.core.results import plain
from picchio.studies.placement.run import place

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests" / "studies"))

CASES: dict[str, tuple[str | None, list[float], list[int], int]] = {
    # S-N curve; how far the work may go, m and rad; grid; placements tried all over.
    "paper, steel": (None, [0.2, 0.2, 0.3, 0.4], [5, 3, 5, 3], 100),
    "paper": ("nie-2016", [0.2, 0.2, 0.3, 0.4], [5, 3, 5, 3], 100),
    "ur10": ("nie-2016", [0.1, 0.1, 0.1, 0.5], [3, 1, 3, 3], 40),
    "panda": ("nie-2016", [0.1, 0.1, 0.1, 0.5], [3, 1, 3, 3], 40),
}


def compare(name: str) -> dict[str, Any]:
    import placement_grid as grid

    curve, half, counts, placements = CASES[name]
    panel = grid.paper_panel() if name.startswith("paper") else grid.small_panel(name)
    robot, task = panel
    place(robot, task, move=[0.0] * 4, placements=1, sn_curve=curve)  # compiles
    began, spent = time.perf_counter(), time.process_time()
    found = place(robot, task, move=half, placements=placements, sn_curve=curve)
    search = time.perf_counter() - began, time.process_time() - spent
    moves = grid.grid_moves(half, counts)
    began, spent = time.perf_counter(), time.process_time()
    (damage, used), reached = grid.brute_force(robot, task, moves, curve)
    brute = time.perf_counter() - began, time.process_time() - spent
    near = [off for off in found.off if off.reached]
    return {
        "case": name,
        "rivets": task.rivets_per_pass,
        "rivets_now": found.start.rivets_to_failure,
        "rivets_best": found.best.rivets_to_failure,
        "rivets_grid": 1.0 / damage if damage > 0.0 else math.inf,
        "utilisation_now": found.start.utilisation,
        "utilisation_best": found.best.utilisation,
        "utilisation_grid": used,
        "off_life": min((off.rivets_to_failure for off in near), default=math.nan),
        "off_utilisation": max((off.utilisation for off in near), default=math.nan),
        "off_lost": len(found.off) - len(near),
        "looked_at": found.placements + found.nearby,
        "grid_points": len(moves),
        "grid_reached": reached,
        "seconds": search,
        "grid_seconds": brute,
    }


def count(number: float) -> str:
    return "unlimited" if math.isinf(number) else "-" if math.isnan(number) else f"{number:.4g}"


def show(row: dict[str, Any]) -> None:
    took = {
        "now": "",
        "best": f"{row['looked_at']:5d} places, {row['seconds'][0]:.0f} s "
        f"({row['seconds'][1]:.0f} s of processor)",
        "grid": f"{row['grid_points']:5d} places, {row['grid_reached']} in reach, "
        f"{row['grid_seconds'][0]:.0f} s ({row['grid_seconds'][1]:.0f} s of processor)",
    }
    for label, key in (("now", "now"), ("placed", "best"), ("grid", "grid")):
        name, rivets = row["case"] if key == "now" else "", count(row[f"rivets_{key}"])
        used = 100 * row[f"utilisation_{key}"]
        print(f"{name:13s} {label:7s} {rivets:>10s}  {used:10.3f} %  {took[key]}".rstrip())
    print(
        f"{'':13s} 5 cm off {count(row['off_life']):>9s}  {100 * row['off_utilisation']:10.3f} %"
        f"  at worst; out of reach in {row['off_lost']} of 6 ways",
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", metavar="FILE")
    parser.add_argument("--only", metavar="NAME", choices=list(CASES))
    options = parser.parse_args()
    warnings.simplefilter("ignore", picchio.PicchioWarning)  # of assumed shafts, and of the curve
    print("case          where        rivets  utilisation    what it took")
    rows = []
    numba.set_num_threads(1)
    for name in CASES:
        if options.only in (None, name):
            rows.append(compare(name))
            show(rows[-1])
    if options.json:
        content = {"format": "picchio-placement-benchmark/1", "cases": rows}
        with atomic_write(options.json) as stream:
            stream.write(json.dumps(plain(content), indent=2) + "\n")


if __name__ == "__main__":
    main()
