"""Joint stiffness from nothing: blind trials, and a real arm under static loads.

    python benchmarks/stiffness.py --blind 200 [--first 1000] [--json FILE]
    python benchmarks/stiffness.py --frf 200 [--first 2000] [--json FILE]
    python benchmarks/stiffness.py --taps 60 [--unknown] [--first 3000] [--json FILE]
    python benchmarks/stiffness.py --clamped 90 [--first 4000] [--json FILE]
    python benchmarks/stiffness.py --trains 30 [--first 5000] [--json FILE]
    python benchmarks/stiffness.py --others 1 [--first 61000]
    python benchmarks/stiffness.py --real DATA [--repeats 5] [--json FILE]

Blind: campaigns of `tests/worlds/loads.py`, arms with 3, 6 and 7 joints in turn, stiffness off by
up to a factor of four, everything slightly wrong; with --frf those of `tests/worlds/frfs.py`, 18
frequency response functions each; with --taps those of `tests/worlds/taps.py`, six blows in time,
with --unknown without their force; with --clamped those of `tests/worlds/presses.py`, whose motors
press while the tool is held; with --trains twelve records of usual blows each, of which every
other campaign has no deflections. Others: campaigns with one cause of any kind, or with none that
the catalogue has, so many draws of each, files exact and a little wrong: how often springs are
sought from nothing though no stiffness is far from stated. Real: DATA is the folder of measured
data; 43 loadings of a FANUC R-2000iC (`r2000ic-static`), published stiffness against plain least
squares and against `picchio identify`; then each cause that may leave a fifth of the signal
unexplained, judged on loadings left out: ten folds, so many times as `--repeats` says.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import picchio
from picchio.campaign.campaign import Campaign
from picchio.campaign.loadings import read_loadings
from picchio.campaign.record import Record
from picchio.campaign.tables import Tolerance
from picchio.core.files import atomic_write
from picchio.core.processes import one_thread
from picchio.diagnosis.begin import begin
from picchio.diagnosis.stiffness.fit import Fit, Problem, fit
from picchio.diagnosis.stiffness.prior import prior_of, suspects
from picchio.diagnosis.stiffness.select import folds, held_out
from picchio.diagnosis.stiffness.static import identify_static
from picchio.diagnosis.stiffness.statics import make_table
from picchio.model.expansion import WideChain

TESTS = Path(__file__).resolve().parent.parent / "tests"
sys.path[:0] = [str(TESTS / each) for each in ("", "diagnosis/blind", "diagnosis/stiffness")]
import blind_stiffness  # noqa: E402
import trial  # noqa: E402

from worlds import frfs, loads, presses, taps  # noqa: E402
from worlds.effects import EFFECTS  # noqa: E402
from worlds.outside import EFFECTS as OUTSIDE  # noqa: E402

ROBOT = "fanuc_r2000ic"


def blind(count: int, first: int) -> dict[str, Any]:
    start = time.process_time()
    judged = blind_stiffness.static_trial(loads, count, first)
    found = blind_stiffness.summary(judged)
    for size in blind_stiffness.SIZES:
        own = [one for one in judged if one.robot == loads.ROBOTS[size]]
        part = blind_stiffness.summary(own)
        print(f"{loads.ROBOTS[size]:16s} told {part['told']} of {part['joints']}, "
              f"median error {100 * part['median_error']:.2f} %, "
              f"coverage {100 * part['coverage_told']:.1f} %")  # fmt: skip
    for name, value in found.items():
        print(f"{name:24s} {value:.4g}")
    print(f"processor time a campaign  {(time.process_time() - start) / count:.2f} s")
    return {"blind": found, "joints": [vars(one) for one in judged]}


def responses(trial: Any, count: int, first: int) -> dict[str, Any]:
    start = time.process_time()
    stiffness, damping = trial(count=count, first=first)
    found: dict[str, Any] = {}
    for what, judged in (("stiffness", stiffness), ("damping", damping)):
        if not judged:
            continue
        found[what] = blind_stiffness.summary(judged)
        print(what)
        for name, value in found[what].items():
            print(f"  {name:24s} {value:.4g}")
    print(f"processor time a campaign  {(time.process_time() - start) / count:.2f} s")
    found["joints"] = [vars(one) for one in (*stiffness, *damping)]
    return found


def others(draws: int, first: int) -> dict[str, Any]:
    robot, began, count = picchio.load_robot("fanuc_like_3dof"), [], 0
    for mismatch in (0.0, 1.0):
        for kind, names in (("single", EFFECTS), ("outside", OUTSIDE)):
            for name, draw in itertools.product(names, range(first, first + draws)):
                case = {"robot": robot.name, "kind": kind, "effect": name, "snr": 40,
                        "draw": draw, "mismatch": mismatch}  # fmt: skip
                campaign, truth = trial.make(case, 1)
                count += 1
                if begin(robot, campaign) is not None:
                    began.append({**case, "causes": truth["causes"]})
                    print(f"from nothing: {mismatch:g} times wrong, {truth['causes']}", flush=True)
    print(f"sought from nothing in {len(began)} of {count} campaigns with one other cause")
    return {"campaigns": count, "began": began}


def read(folder: Path) -> Campaign:
    """The table of the source as a campaign: the angles are the controller's."""
    table = np.genfromtxt(folder / "r2000ic-static" / "loads.csv", delimiter=",", skip_header=1)
    columns = {f"pose.joint_{k + 1}": table[:, k] for k in range(6)}
    columns |= {f"force.{axis}": table[:, 6 + k] for k, axis in enumerate("xyz")}
    columns |= {f"displacement.tcp.{axis}": table[:, 9 + k] for k, axis in enumerate("xyz")}
    turned = {f"joint_{k}": {f"joint_{k}": -1.0} for k in (4, 5, 6)}
    mapped = {"joint_3": {"joint_2": -1.0, "joint_3": -1.0}, **turned}
    record = Record.from_columns("loads.csv", columns, kind="static", joint_map=mapped)
    return Campaign.from_records([record], robot=ROBOT)


def plain(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Least squares in the compliances, no prior, no outliers: k and its relative deviation."""
    (table,) = problem.tables
    n = problem.joints
    (part,) = problem.predict(np.zeros(len(problem.precision)))
    matrix, values = -part.slope[..., :n].reshape(-1, n), table.values.ravel()
    share, *_ = np.linalg.lstsq(matrix, values, rcond=None)
    left = values - matrix @ share
    size = left @ left / (len(values) - n)
    spread = np.sqrt(np.diag(size * np.linalg.inv(matrix.T @ matrix)))
    return 1.0 / share, spread / np.abs(share)


@one_thread()
def real(folder: Path, repeats: int) -> dict[str, Any]:
    robot, campaign = picchio.load_robot(ROBOT), read(folder)
    problem = problem_of(robot, campaign, campaign.tolerance)
    alone = identify_static(robot, campaign, search=False)
    whole = picchio.identify(robot, campaign)
    factor, deviation = plain(replace(problem, gravity=False))
    print(
        "joint      published  least squares     springs alone, 90 %            with causes, 90 %"
    )
    for k, name in enumerate(robot.flexible_names):
        a, b = alone.joints[k].stiffness, whole.joints[k].stiffness
        print(f"{name}  {robot.stiffness[k]:9.3g}  {robot.stiffness[k] * factor[k]:9.3g} "
              f"+-{100 * deviation[k]:3.0f} %  {a.value:9.3g} ({a.low:.2g} to {a.high:.2g})"
              f"{' told' if a.told else '     '}  {b.value:9.3g} ({b.low:.2g} to {b.high:.2g})"
              f"{' told' if b.told else ''}")  # fmt: skip
    print(*whole.remarks, sep="\n")
    base = judge(fit(problem), repeats)
    print(f"\nLoadings left out, {repeats} times ten folds: log density, residual over signal")
    rows = {"joint springs alone": base}
    show("joint springs alone", base, base)
    loose = {
        "no outliers: normal errors": replace(problem, robust=False),
        "no gravity stiffness": replace(problem, gravity=False),
    }
    for words, changes in (
        ("displacements' axes off by 0.1 rad", {"sensor_angle": 0.1}),
        ("forces' directions off by 0.05 rad", {"direction": 0.05}),
        ("force scale off by 20 %", {"static_force": 0.2}),
        ("joint zeros off by 0.02 rad", {"pose": 0.02}),
    ):
        loose[words] = problem_of(robot, campaign, Tolerance(**changes))
    every = {one.words: one for one in suspects(robot, 2.0)}
    loose |= {words: replace(problem, causes=(one,)) for words, one in every.items()}
    first = every["the force acts elsewhere than told"]
    for joint in ("joint_3", "joint_4"):
        words = f"the bearing of {joint} tilts"
        both = (every[words], first)
        loose[f"{words}, and another point"] = replace(problem, causes=both)
    for words, changed in loose.items():
        rows[words] = judge(fit(changed), repeats)
        show(words, rows[words], base)
    return {"real": whole.to_dict(), "left_out": rows}


def problem_of(robot: Any, campaign: Campaign, tolerance: Tolerance) -> Problem:
    chain = WideChain(robot)
    tables = tuple(make_table(robot, chain, read_loadings(r), tolerance) for r in campaign)
    return Problem(tables, prior_of(robot), {"displacement": tolerance.dial})


def judge(found: Fit, repeats: int) -> dict[str, float]:
    left = [held_out(found, folds(found.problem, 10, seed)) for seed in range(repeats)]
    return {
        "evidence": found.evidence,
        "score": float(np.mean([one.score for one in left])),
        "nrmse": float(np.mean([one.nrmse for one in left])),
        "spread": float(np.std([one.nrmse for one in left])),
    }


def show(words: str, row: dict[str, float], base: dict[str, float]) -> None:
    print(f"  {words:52s} {row['score'] - base['score']:+7.1f}  {100 * row['nrmse']:.1f} %"
          f"   evidence {row['evidence'] - base['evidence']:+.1f}", flush=True)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--blind", type=int, default=0)
    parser.add_argument("--frf", type=int, default=0)
    parser.add_argument("--taps", type=int, default=0)
    parser.add_argument("--clamped", type=int, default=0)
    parser.add_argument("--trains", type=int, default=0)
    parser.add_argument("--others", type=int, default=0)
    parser.add_argument("--unknown", action="store_true")
    parser.add_argument("--first", type=int, default=1000)
    parser.add_argument("--real", type=Path)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    found: dict[str, Any] = {}
    if given.real is not None:
        found |= real(given.real, given.repeats)
    if given.blind:
        found |= blind(given.blind, given.first)
    if given.frf:
        trial = partial(blind_stiffness.frf_trial, frfs)
        found["frf"] = responses(trial, given.frf, given.first)
    if given.taps:
        trial = partial(blind_stiffness.tap_trial, taps, known=not given.unknown)
        found["taps"] = responses(trial, given.taps, given.first)
    if given.trains:
        found["trains"] = responses(blind_stiffness.train_trial, given.trains, given.first)
    if given.others:
        found["others"] = others(given.others, given.first)
    if given.clamped:
        found["clamped"] = responses(
            partial(blind_stiffness.press_trial, presses), given.clamped, given.first
        )
    if given.json is not None:
        with atomic_write(given.json) as stream:
            json.dump(found, stream, indent=1, default=lambda number: number.item())  # numpy


if __name__ == "__main__":
    main()
