"""The sampling intervals of `uncertain_life` against a plain Monte Carlo of 100,000 draws.

    python benchmarks/uncertainty.py            # coverage: 3 robots x 3 quantiles x 40 seeds
    python benchmarks/uncertainty.py --plain    # makes the plain Monte Carlo anew (some minutes)

The plain Monte Carlo draws with numpy's generator, a world at a time, and has only the compiled
response and the counting in common with what it tests. Force and model error it takes in closed
form: on a straight S-N curve damage goes with the load to the power of its slope. The first 20
draws are also assessed, each on a changed robot. What it found lies in
`tests/studies/plain_monte_carlo.json`.
"""

from __future__ import annotations

import argparse
import json
import math
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import picchio
from picchio.fatigue.shaft_stress import stress_per_torque
from picchio.fatigue.sn.curve import SNCurve
from picchio.fatigue.uncertain_lives import QUANTILES
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.studies.rivet.damage_kernel import history_damage, swing
from picchio.studies.tasks import Task, task_from_dict
from picchio.studies.uncertainty.inputs import DEFAULT_INPUTS
from picchio.studies.uncertainty.result import UncertainLife
from picchio.vibration.batch.turning_kernel import FINE

CACHE = Path(__file__).parents[1] / "tests" / "studies" / "plain_monte_carlo.json"
DRAWS = 100_000
CURVE = SNCurve(name="straight", strength=60e6, cycles=1e6, slopes=(5.0,))
_MODULUS, _LENGTH = 79.3e9, 0.05
# Robot -> a pose, and whether its stiffnesses are estimates (else: a spread of 1.3 each).
ROBOTS: dict[str, tuple[list[float], bool]] = {
    "fanuc_like_3dof": ([0.3, 1.1, -1.0], False),
    "ur10": ([0.3, -1.2, 1.5, -0.4, 0.6, 0.2], True),
    "kuka_iiwa14": ([0.2, 0.6, 0.1, -1.2, 0.3, 0.8, 0.0], True),
}


def case(name: str) -> tuple[FlexibleRobot, Task]:
    """A robot whose joints all have a spread and a shaft as stiff as they are, and its task."""
    pose, guess = ROBOTS[name]
    bare = picchio.load_robot(name)
    values: dict[str, dict[str, Any]] = {}
    for joint in bare.flexible_joints:
        radius = (2.0 * joint.stiffness * _LENGTH / (math.pi * _MODULUS)) ** 0.25
        shaft = {"radius": radius, "length": _LENGTH, "shear_modulus": _MODULUS}
        values[joint.name] = {"stiffness": joint.stiffness, "shaft": shaft}
        values[joint.name] |= {"estimated": True} if guess else {"stiffness_spread": 1.3}
    robot = picchio.load_robot(name, values=values)
    task = {
        "hits_per_rivet": 3,
        "excitation": {"kind": "pulse_train", "force": 100.0, "period": 0.04, "width": 0.004},
        "operation": [{"name": "up", "direction": [0.3, 0.2, 1.0], "poses": [pose]}],
    }
    return robot, task_from_dict(task, robot)


def plain(name: str, draws: int = DRAWS, seed: int = 2026) -> dict[str, Any]:
    """Quantiles of the life by plain Monte Carlo, each with a 95 % interval (order statistics)."""
    robot, task = case(name)
    (operation,) = task.operations
    joints, state = robot.flexible_joints, robot.state(operation.poses[0])
    rng = np.random.default_rng(seed)
    spread = {name: each.spread for name, each in DEFAULT_INPUTS.items()}
    own = np.array([robot.spreads[f"stiffness.{joint.name}"].size for joint in joints])
    damped = [robot.spreads.get(f"damping_ratio.{joint.name}") for joint in joints]
    known = np.array([0.0 if each is None else each.size for each in damped])
    knots, lines = CURVE.lines()[1][:0], np.stack(CURVE.lines(), axis=1)
    factor = stress_per_torque(joints)
    frequency, whole = np.empty(len(joints)), np.full(len(joints), -1.0)
    lives = np.empty(draws)
    for k in range(draws):
        stiffness = robot.stiffness * np.exp(own * rng.standard_normal(len(joints)))
        each = np.exp(known * rng.standard_normal(len(joints)))
        common = math.exp(spread["damping_ratio"] * rng.standard_normal())
        damping = robot.damping_ratio * np.where(known > 0.0, each, common)
        blows = operation.excitation.scaled(width=math.exp(spread["width"] * rng.standard_normal()))
        load = math.exp(math.hypot(spread["force"], spread["model"]) * rng.standard_normal())
        force = blows.burst(operation.hits_per_rivet)
        turns, count = swing(
            state.mass_matrix, state.jacobian, stiffness, damping, operation.direction, whole,
            force.duration, force.constant, force.slope, force.amplitude,
            force.angular_frequency, frequency, FINE,
        )  # fmt: skip
        scratch = np.empty((3, turns.shape[1]))
        spent = [
            history_damage(row[:n], factor[j] * stiffness[j], knots, lines, *scratch)
            for j, (row, n) in enumerate(zip(turns, count, strict=True))
        ]
        lives[k] = 1.0 / (max(spent) * load ** CURVE.slopes[0]) if spent else math.nan
        if k >= 20 and spent:
            continue
        # The same draw by assess, on another robot; of one damped beyond critical only this.
        changed = tuple(
            replace(joint, stiffness=stiff, damping_ratio=ratio)
            for joint, stiff, ratio in zip(joints, stiffness, damping, strict=True)
        )
        other = replace(operation, excitation=blows.scaled(force=load))
        told = picchio.assess(
            replace(robot, flexible_joints=changed, spreads={}),
            replace(task, operations=(other,)), sn_curve=CURVE, steady_check=False,
        ).rivets_to_failure  # fmt: skip
        if spent and not math.isclose(told, lives[k], rel_tol=1e-4):
            raise SystemExit(f"{name}, draw {k}: assess gives {told:g}, not {lives[k]:g}")
        lives[k] = told
    lives.sort()
    table = {}
    for quantile, p in QUANTILES.items():
        reach = 1.96 * math.sqrt(p * (1.0 - p) / draws)
        table[quantile] = [float(np.quantile(lives, level)) for level in (p, p - reach, p + reach)]
    return {"draws": draws, "seed": seed, "quantiles": table}


def covered(found: UncertainLife, known: dict[str, Any]) -> dict[str, bool]:
    """Whether each quantile's sampling interval holds the plain one, whose own error is added."""
    told = {}
    for quantile, (value, least, most) in known["quantiles"].items():
        ours = math.log(found.robot.quantiles[quantile])
        low, high = (math.log(end) for end in found.robot.sampling[quantile])
        error = 0.5 * math.log(most / least)
        below, above = math.hypot(ours - low, error), math.hypot(high - ours, error)
        told[quantile] = ours - below <= math.log(value) <= ours + above
    return told


def coverage(names: list[str], seeds: int, samples: int) -> dict[str, dict[str, float]]:
    """Share of the seeds whose intervals hold the plain quantile, by robot and quantile."""
    known = json.loads(CACHE.read_text())
    table = {}
    for name in names:
        robot, task = case(name)
        told = [
            covered(
                picchio.uncertain_life(robot, task, sn_curve=CURVE, samples=samples, seed=seed,
                                       totals=False), known[name])
            for seed in range(seeds)
        ]  # fmt: skip
        table[name] = {q: float(np.mean([each[q] for each in told])) for q in QUANTILES}
    return table


def main() -> None:
    """Print the table, or make the plain Monte Carlo."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--plain", action="store_true", help="make the plain Monte Carlo anew")
    parser.add_argument("--draws", type=int, default=DRAWS)
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--samples", type=int, default=1024)
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    if given.plain:
        CACHE.write_text(
            json.dumps({name: plain(name, given.draws) for name in ROBOTS}, indent=1) + "\n"
        )
    table = coverage(list(json.loads(CACHE.read_text())), given.seeds, given.samples)
    for name, row in table.items():
        print(f"{name:18s}", *(f"{q} {100 * share:5.1f} %" for q, share in row.items()))
    every = float(np.mean([share for row in table.values() for share in row.values()]))
    count = 3 * len(table) * given.seeds
    print(f"all: {100 * every:.1f} % of {count} intervals hold the plain quantile")


if __name__ == "__main__":
    main()
