"""How honest the answer for a robot is of which nothing but the URDF is known.

    python benchmarks/estimated_robots.py coverage [--count 500] [--minutes 15]
    python benchmarks/estimated_robots.py ranking [--count 40]
    python benchmarks/estimated_robots.py hidden

coverage: robots are drawn from the drive priors themselves (the mixture, not its normal
approximation), with a material, a force and a model error of their own, and assessed one by one by
the exact method. How often does the interval of `picchio.assess`, which sees the URDF alone, hold
what comes out? Aimed at: 75 to 85 % for an interval of 80 %.

ranking: what a measurement leaves of the interval is computed anew by brute force: readings are
drawn, the inputs conditioned on each, and fresh worlds run. Is the measurement that was ranked
first within 10 % of the best one's narrowing? Aimed at: in 80 % of the cases.

hidden: six robots whose stiffness was measured are assessed with and without it, on one task.

This tests how what is uncertain is carried through; how true the priors are: drive_priors.py.
"""

from __future__ import annotations

import argparse
import math
import shutil
import tempfile
import time
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import picchio
from picchio.fatigue.sn.library import DEFAULT_LIFE_CURVE, load_sn_curve, write_sn_curve
from picchio.model.model import Model
from picchio.robot.drives.facts import fitted, group_of
from picchio.robot.drives.hierarchy import Group, predict
from picchio.robot.drives.predictors import QUANTITIES, predictors
from picchio.robot.drives.priors import _with_strength
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.joint import Joint, Strength
from picchio.robot.spread import root_of
from picchio.studies.default_task import default_task
from picchio.studies.rivet.variation import WornParts
from picchio.studies.tasks import Task
from picchio.studies.uncertainty import measurements
from picchio.studies.uncertainty.inputs import DEFAULT_INPUTS
from picchio.studies.uncertainty.sampler import Sampler

ARMS = (
    "ur5", "ur10", "panda", "xarm7", "z1", "kinova", "kuka_iiwa14", "abb_irb2600", "fanuc_m20ia",
    "fanuc_r2000ic", "kuka_kr210_r2700",
)  # fmt: skip
SAMPLES = 512  # as many as `assess` takes of 15 places
KNOWN = ("fanuc_r2000ic", "kuka_kr210_r2700", "kuka_kr500_r2830mt", "kuka_kr300_r2500",
         "manutec_r3", "kuka_iiwa14")  # fmt: skip


def bare(name: str, folder: Path) -> FlexibleRobot:
    """A shipped arm of which only the URDF is there."""
    found = picchio.load_robot(name, allow_rigid=True)
    copy = folder / f"{name}.urdf"
    shutil.copy(found.source, copy)
    return picchio.load_robot(copy, tool=found.tool_frame)


def hard(task: Task, robot: FlexibleRobot) -> Task:
    """The default task with blows that a robot of this size feels: a tenth of its strength."""
    strongest = max(
        joint.strength.repeated_peak_torque for joint in robot.flexible_joints if joint.strength
    )
    factor = max(1.0, strongest / 300.0)
    return replace(task, operations=tuple(
        replace(op, excitation=op.excitation.scaled(force=factor)) for op in task.operations
    ))  # fmt: skip


def drawn(robot: FlexibleRobot, rng: np.random.Generator, folder: Path) -> tuple[Any, ...]:
    """A robot drawn from the priors, and its own factors on force, width and stress."""
    draw = draw_of(robot, rng)
    curve = load_sn_curve(DEFAULT_LIFE_CURVE)
    assert curve.scatter is not None and curve.survival is not None
    factor = 10.0 ** (curve.scatter * rng.standard_normal())
    specimen = curve.at_survival(0.5).scaled(factor, "drawn")
    file = folder / "specimen.toml"
    write_sn_curve(replace(specimen, name="specimen"), file)
    joints: list[Joint] = []
    for joint in robot.flexible_joints:
        stiffness, damping, peak = draw[joint.name]
        strength = Strength(repeated_peak_torque=peak, life_curve=str(file))
        joints.append(replace(joint, stiffness=stiffness, damping_ratio=damping, strength=strength))
    made = replace(robot, flexible_joints=tuple(joints), spreads={}, posterior=None)
    factors = {name: math.exp(DEFAULT_INPUTS[name].spread * rng.standard_normal())
               for name in ("force", "width", "model")}  # fmt: skip
    return made, factors


def draw_of(
    robot: FlexibleRobot, rng: np.random.Generator
) -> dict[str, tuple[float, float, float]]:
    """Stiffness, damping ratio and repeated-peak torque of every joint: one draw of the mixture.

    As `drive_priors` makes it, before it is told by its mean and covariance.
    """
    found, fit = predictors(robot), fitted()
    n = len(found.names)
    mixture = predict(fit.stiffness, group_of(found), also=2 + QUANTITIES.index("effort"))
    nothing = Group(np.full((n, 1), np.nan), np.zeros((n, 0)), np.zeros(n, dtype=np.intp))
    both = np.exp(pick(_with_strength(mixture, found, {}, None), rng))
    damping = np.exp(pick(predict(fit.damping, nothing), rng))
    return {name: (both[k], damping[k], both[n + k]) for k, name in enumerate(found.names)}


def pick(mixture: Any, rng: np.random.Generator) -> np.ndarray:
    weights, means, covs = mixture
    k = rng.choice(len(weights), p=weights / weights.sum())
    sizes, vectors = np.linalg.eigh(covs[k])
    scores = rng.standard_normal(len(sizes))
    return means[k] + vectors @ (np.sqrt(np.clip(sizes, 0.0, None)) * scores)


def exactly(robot: FlexibleRobot, task: Task, factors: dict[str, float]) -> picchio.Assessment:
    """One robot, one task: the exact method, nothing varied."""
    force = factors["force"] * factors["model"]  # of a linear model the stress goes with the force
    operations = tuple(
        replace(op, excitation=op.excitation.scaled(force=force, width=factors["width"]))
        for op in task.operations
    )
    task = replace(task, operations=operations)
    return picchio.assess(robot, task, uncertainty=False, steady_check=False)


def coverage(count: int, seed: int, minutes: float) -> None:
    rng, began = np.random.default_rng(seed), time.monotonic()
    inside: dict[str, list[bool]] = {"robot": [], "joint": []}
    by_arm: dict[str, list[bool]] = {}
    below = []
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        told = {}
        for name in ARMS:
            robot = bare(name, folder)
            for strong in (False, True):
                task = default_task(robot)
                task = hard(task, robot) if strong else task
                life = picchio.uncertain_life(robot, task, samples=SAMPLES, totals=False)
                told[name, strong] = robot, task, life
        for k in range(count):
            if time.monotonic() - began > 60.0 * minutes:
                print(f"stopped after {minutes:g} minutes: {k} of {count} robots")
                break
            name, strong = ARMS[k % len(ARMS)], bool((k // len(ARMS)) % 2)
            robot, task, life = told[name, strong]
            made, factors = drawn(robot, rng, folder)
            found = exactly(made, task, factors)
            use = {joint.name: joint.utilisation for joint in found.joints}
            for joint, value in use.items():
                low, high = life.intervals[joint]["utilisation"]
                inside["joint"].append(low <= value <= high)
            shortest = min(joint.rivets_to_failure for joint in found.joints)
            spread = life.robot
            if math.isinf(spread.p90):  # no life: its utilisation
                ends = life.utilisation
                hit = ends["p10"] <= max(use.values()) <= ends["p90"]
                below.append(max(use.values()) < ends["p10"])
            else:
                hit = spread.p10 <= shortest <= spread.p90
                below.append(shortest > spread.p90)
            inside["robot"].append(hit)
            by_arm.setdefault(f"{name}{', hard blows' if strong else ''}", []).append(hit)
    for name, hits in sorted(by_arm.items()):
        print(f"{name:35s} {100 * np.mean(hits):5.1f} % of {len(hits)}")
    for what, hits in inside.items():
        share, size = float(np.mean(hits)), len(hits)
        error = 1.96 * math.sqrt(share * (1.0 - share) / min(size, len(below)))
        print(f"{what}: P10 to P90 holds {100 * share:.1f} % (+- {100 * error:.1f}) of {size}")
    print(f"beyond the interval on its mild side: {100 * np.mean(below):.1f} %")


def ranking(count: int, seed: int, readings: int = 24, worlds: int = 256) -> None:
    rng = np.random.default_rng(seed)
    good = []
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        for k in range(count):
            name = ARMS[k % len(ARMS)]
            robot = bare(name, folder)
            task = default_task(robot, seed=k)
            task = hard(task, robot) if k // len(ARMS) % 2 else task
            life = picchio.uncertain_life(robot, task, samples=SAMPLES, totals=False)
            if not life.measure_first:
                continue
            model = Model.of(robot)
            sampler = Sampler.of(model, task, WornParts.of(model.robot, None), None, [])
            names = [each.name for each in sampler.inputs]
            root = root_of(names, robot.posterior)
            left = {}
            for what, _, _, columns, error in measurements._candidates(robot, sampler.inputs):
                size = np.array([sampler.inputs[i].uncertain.spread for i in columns])
                left[what] = expected(sampler, root @ root.T, columns, error / size,
                                      rng, readings, worlds)  # fmt: skip
            free = np.linalg.cholesky(root @ root.T + 1e-9 * np.eye(len(root)))
            now = width(sampler, rng.standard_normal((4096, len(names))) @ free.T)
            narrowing = {what: now - then for what, then in left.items()}
            first, best = life.measure_first[0].what, max(narrowing, key=lambda w: narrowing[w])
            good.append(narrowing[first] >= 0.9 * narrowing[best])
            print(
                f"{name:20s} now {now:.2f}, ranked first {first} leaves {left[first]:.2f}, best "
                f"{best} leaves {left[best]:.2f}{'' if good[-1] else '   MISSED'}",
                flush=True,
            )
    print(f"within 10 % of the best's narrowing: {100 * np.mean(good):.0f} % of {len(good)}")


def expected(sampler: Sampler, cov: np.ndarray, columns: list[int], error: np.ndarray,
             rng: np.random.Generator, readings: int, worlds: int) -> float:  # fmt: skip
    """The mean width over drawn readings, the inputs conditioned on each: brute force."""
    read = cov[np.ix_(columns, columns)] + np.diag(np.maximum(error, 1e-6) ** 2)
    gain = np.linalg.solve(read, cov[columns]).T
    rest = cov - gain @ cov[columns]
    sizes, vectors = np.linalg.eigh(0.5 * (rest + rest.T))
    half = vectors * np.sqrt(np.clip(sizes, 0.0, None))
    found = []
    for _ in range(readings):
        middle = gain @ (np.linalg.cholesky(read) @ rng.standard_normal(len(columns)))
        found.append(width(sampler, middle + rng.standard_normal((worlds, len(cov))) @ half.T))
    return float(np.mean(found))


def width(sampler: Sampler, moved: np.ndarray) -> float:
    """P10 to P90 of the logarithm of the robot's utilisation."""
    low, high = np.quantile(np.log10(sampler.run(moved).robots_use), [0.1, 0.9])
    return float(high - low)


def hidden() -> None:
    print("| robot | joint | peak torque, N m: true stiffness | estimated, P10 to P90 | factor |")
    print("|---|---|---|---|---|")
    lives, held, factors = [], [], []
    with tempfile.TemporaryDirectory() as text:
        for name in KNOWN:
            robot = bare(name, Path(text))
            task = default_task(robot)
            told = picchio.uncertain_life(robot, task, samples=SAMPLES, totals=False)
            known = picchio.load_robot(name, tool=robot.tool_frame)
            # Rigid wrists and arms: only joints that both have are compared.
            true = picchio.assess(known, task, uncertainty=False, steady_check=False)
            guess = picchio.assess(robot, task, uncertainty=False, steady_check=False)
            for joint in true.joints:
                peak, own = joint.peak_torque, guess.joint(joint.name).peak_torque
                low, high = told.intervals[joint.name]["peak_torque"]
                whole = whole_peak(true, joint.name)
                held.append(low <= whole <= high)
                factors.append(abs(math.log(own / peak)))
                print(f"| {name} | {joint.name} | {whole:.4g} | {low:.3g} to {high:.3g} | "
                      f"{own / peak:.2f} |")  # fmt: skip
            life = picchio.uncertain_life(known, task, samples=SAMPLES, totals=False)
            lives.append((name, life, told))
    print(f"\npeak torque in the interval: {sum(held)} of {len(held)}; median factor of the "
          f"vibration's peak {math.exp(float(np.median(factors))):.2f}\n")  # fmt: skip
    print(
        "| robot | utilisation, true stiffness, P10 to P90 | estimated | life, true | estimated |"
    )
    print("|---|---|---|---|---|")
    for name, life, told in lives:
        ends = [f"{100 * one.utilisation['p10']:.2g} to {100 * one.utilisation['p90']:.2g} %"
                for one in (life, told)]  # fmt: skip
        print(f"| {name} | {ends[0]} | {ends[1]} | {life.robot.told} | {told.robot.told} |")


def whole_peak(found: picchio.Assessment, name: str) -> float:
    """N m, gravity and blows together, from the limits that were checked."""
    return found.joint(name).reducer_limits[0].torque


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("what", choices=("coverage", "ranking", "hidden"))
    parser.add_argument("--count", type=int)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--minutes", type=float, default=math.inf, help="of coverage, at most")
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    if asked.what == "coverage":
        coverage(asked.count or 500, asked.seed, asked.minutes)
    elif asked.what == "ranking":
        ranking(asked.count or 40, asked.seed)
    else:
        hidden()


if __name__ == "__main__":
    main()
