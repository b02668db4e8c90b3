"""How honest the answer for a robot is of which nothing but the URDF is known.

    python benchmarks/estimated_robots.py coverage [--count 500] [--minutes 15]
    python benchmarks/estimated_robots.py ranking [--count 44] [--minutes 30]
    python benchmarks/estimated_robots.py hidden

coverage: robots are drawn from the drive priors themselves (the mixture, not its normal
approximation), with a material, a force and a model error of their own, and assessed one by one by
the exact method. How often does the interval of `picchio.assess`, which sees the URDF alone, hold
what comes out? Aimed at: 75 to 85 % for an interval of 80 %.

ranking: what each measurement narrows the interval by is told anew from 16,384 drawn worlds, where
the command draws 512. If the best one is another than the command's first, both are done: 48 truths
are drawn from the priors and read with the error, and 512 worlds that fit each reading are run. Is
the first one within 10 % of the best one's narrowing? Aimed at: in 80 % of the cases. The tasks
have one operation at one pose, drawn anew for each case, to be quick; every second round has hard
blows.

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
from picchio.robot.drives.facts import effort_beside, fitted, group_of, stiffness_beside
from picchio.robot.drives.hierarchy import Group, predict
from picchio.robot.drives.predictors import predictors
from picchio.robot.drives.priors import repeated_peaks
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
    group = group_of(found)
    stiffness = np.exp(pick(predict(fit.stiffness, stiffness_beside(group)), rng))
    effort = predict(fit.effort, effort_beside(group), given=True)
    peak = np.exp(pick(repeated_peaks(effort, None), rng))
    nothing = Group(np.full((n, 1), np.nan), np.zeros((n, 0)), np.zeros(n, dtype=np.intp))
    damping = np.exp(pick(predict(fit.damping, nothing), rng))
    return {name: (stiffness[k], damping[k], peak[k]) for k, name in enumerate(found.names)}


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


def ranking(count: int, seed: int, minutes: float, runs: int = 16384) -> None:
    """The measurement ranked first against the best one."""
    began = time.monotonic()
    good: list[bool] = []
    told: list[float] = []
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        for k in range(count):
            if time.monotonic() - began > 60.0 * minutes:
                print(f"stopped after {minutes:g} minutes: {k} of {count} cases")
                break
            rng = np.random.default_rng([seed, k])
            name = ARMS[k % len(ARMS)]
            robot = bare(name, folder)
            task = default_task(robot, seed=k)
            task = hard(task, robot) if k // len(ARMS) % 2 else task
            one = task.operations[k % len(task.operations)]
            task = replace(task, operations=(replace(one, poses=one.poses[:1]),))
            life = picchio.uncertain_life(robot, task, samples=SAMPLES, totals=False)
            model = Model.of(robot)
            sampler = Sampler.of(model, task, WornParts.of(model.robot, None), None, [])
            names = [each.name for each in sampler.inputs]
            root = root_of(names, robot.posterior)
            moved = rng.standard_normal((runs, len(names))) @ root
            drawn = sampler.run(moved)
            endless = math.isinf(life.robot.p90)
            now = width(outcome_of(drawn, endless))
            worlds = measurements.FittedWorlds.of(moved, drawn, endless)
            cov = root @ root
            before = worlds.expected_width(cov, [], np.zeros(0))
            asked, narrowing = {}, {}
            for what, _, _, columns, error in measurements._candidates(robot, sampler.inputs):
                size = error / np.array([sampler.inputs[i].uncertain.spread for i in columns])
                asked[what] = columns, size
                kept = worlds.expected_width(cov, columns, size) / before
                narrowing[what] = now * (1.0 - kept)
            best = max(narrowing, key=lambda what: narrowing[what])
            if not life.measure_first:  # none is worth it: the best one must be worth little
                good.append(narrowing[best] < 2.0 * measurements._WORTH)
                print(f"{name:18s} nothing ranked; best {best} narrows by {narrowing[best]:.3f}")
                continue
            first = life.measure_first[0]
            by = "regressed"
            if first.what != best:  # run both of them
                by = "run"
                for what in (first.what, best):
                    again = np.random.default_rng(seed)
                    left = read_many(sampler, cov, *asked[what], endless, again)
                    narrowing[what] = now - left
            good.append(narrowing[first.what] >= 0.9 * narrowing[best])
            told.append((1.0 - first.kept) * now / narrowing[first.what])
            print(
                f"{name:18s} {'life' if not endless else 'use '} {now:.2f} decades; first "
                f"{first.what}: -{narrowing[first.what]:.3f} (said -{(1.0 - first.kept) * now:.3f})"
                f"; best {best}: -{narrowing[best]:.3f} ({by}){'' if good[-1] else '   MISSED'}",
                flush=True,
            )
    print(f"within 10 % of the best's narrowing: {100 * np.mean(good):.0f} % of {len(good)}")
    print(f"narrowing as said over narrowing: median {np.median(told):.2f}, P10 to P90 "
          f"{np.quantile(told, 0.1):.2f} to {np.quantile(told, 0.9):.2f}")  # fmt: skip


def read_many(
    sampler: Sampler, cov: np.ndarray, columns: list[int], error: np.ndarray, endless: bool,
    rng: Any, readings: int = 48, worlds: int = 512,
) -> float:  # fmt: skip
    """The mean width over drawn readings of several values, the rest conditioned on each."""
    read = cov[np.ix_(columns, columns)] + np.diag(np.maximum(error, 1e-6) ** 2)
    gain = np.linalg.solve(read, cov[columns]).T
    rest = cov - gain @ cov[columns]
    sizes, vectors = np.linalg.eigh(0.5 * (rest + rest.T))
    half = vectors * np.sqrt(np.clip(sizes, 0.0, None))
    found = []
    for _ in range(readings):
        middle = gain @ (np.linalg.cholesky(read) @ rng.standard_normal(len(columns)))
        drawn = sampler.run(middle + rng.standard_normal((worlds, len(cov))) @ half.T)
        found.append(width(outcome_of(drawn, endless)))
    return float(np.mean(found))


def outcome_of(drawn: Any, endless: bool) -> np.ndarray:
    """The logarithm of the robot's utilisation, or of its life where that has an end."""
    return np.log10(drawn.robots_use if endless else np.minimum(drawn.robots_life, 1e30))


def width(outcome: np.ndarray) -> float:
    """P10 to P90, decades."""
    low, high = np.quantile(outcome, [0.1, 0.9], method="median_unbiased")
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
    parser.add_argument(
        "--minutes", type=float, default=math.inf, help="of coverage and ranking, at most"
    )
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    if asked.what == "coverage":
        coverage(asked.count or 500, asked.seed, asked.minutes)
    elif asked.what == "ranking":
        ranking(asked.count or 44, asked.seed, asked.minutes)
    else:
        hidden()


if __name__ == "__main__":
    main()
