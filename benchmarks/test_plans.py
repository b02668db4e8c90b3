"""What planning a test is worth: planned loadings against random ones.

    python benchmarks/test_plans.py --expected [--examples] [--json FILE]
    python benchmarks/test_plans.py --blind 60 [--first 5000] [--json FILE]
    python benchmarks/test_plans.py --real DATA [--json FILE]

Expected: for every shipped robot (with --examples arms of example-robot-data, too, on estimated
drives), how many random loadings (poses drawn as the plan's are, pulls in any direction, the gauge
along the pull; the median of 40 sequences) are needed for the deviation of log peak torque that
the planned ones reach, strength and blows fixed. Blind: campaigns of `tests/worlds/loads.py` at the
planned loadings, and at as many and twice as many random ones; the error of log peak torque after
`picchio identify`. Real: ten of the 43 loadings of a FANUC R-2000iC (`r2000ic-static`) chosen as
the plan chooses, among 1,000 random tens, each judged on the other 33.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import picchio
from picchio.campaign.tables import Tolerance
from picchio.core.files import atomic_write
from picchio.core.processes import one_thread
from picchio.diagnosis.planning.choose import Space, choose
from picchio.diagnosis.planning.kind import Offered, Possible
from picchio.diagnosis.planning.outcome import Life, Outcome, outcome_of
from picchio.diagnosis.planning.plan import _poses
from picchio.diagnosis.planning.static import StaticTest, told
from picchio.diagnosis.stiffness.fit import Problem, climb
from picchio.diagnosis.stiffness.prior import prior_of
from picchio.studies.default_task import possible_poses, task_of

HERE = Path(__file__).resolve().parent
TESTS = HERE.parent / "tests"
sys.path[:0] = [str(TESTS), str(TESTS / "diagnosis" / "stiffness"), str(HERE)]
import blind_stiffness  # noqa: E402
import stiffness as loadings  # noqa: E402

from worlds import loads  # noqa: E402

MOST, SEQUENCES, EXAMPLES = 40, 40, 32


def strongest(robot: Any, task: Any) -> float:
    return min(400.0, max(op.excitation.peak_force for op in task.operations))


def fixed(robot: Any, task: Any) -> Outcome:
    """The outcome with nothing uncertain but the stiffness: strength, blows and damping fixed."""
    found = outcome_of(robot, task, draws=16, seed=0)
    n = len(robot.flexible_joints)
    slope, covariance = found.slope.copy(), found.covariance.copy()
    slope[..., n:] = 0.0
    return replace(found, slope=slope, covariance=covariance, rest=0.0)


def along(space: Space, order: Any) -> list[float]:
    start, found = space.covariance, []
    for index in order:
        space.take(index)
        found.append(math.sqrt(space.variance))
    space.covariance = start
    return found


def at_random(robot: Any, outcome: Outcome, force: float, count: int, seed: int) -> Offered:
    rng = np.random.default_rng(seed)
    poses = possible_poses(robot, count, seed=seed + 1)
    way = rng.standard_normal((len(poses), 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    slopes, own, names = told(robot, poses, force * way, way[:, None], outcome, Tolerance())
    white = (slopes / np.sqrt(own[..., 0])[..., None]).swapaxes(0, 1)
    each = tuple(Possible("static", k, pose, d, force, d, ("dial",))
                 for k, (pose, d) in enumerate(zip(poses, way, strict=True)))  # fmt: skip
    return Offered(StaticTest(), each, names, white)


@one_thread()
def expected(examples: bool) -> dict[str, Any]:
    names = [one.name for one in picchio.robots(examples=False) if one.dof]
    if examples:
        names += arms(EXAMPLES)
    rows = []
    for name in names:
        try:
            robot = picchio.load_robot(name)
            task = task_of(robot)
            outcome = fixed(robot, task)
            poses, _ = _poses(robot, task, 0)
            force = strongest(robot, task)
            offered = StaticTest().candidates(robot, poses, outcome, force, ("scale", "dial"),
                                              Tolerance())  # fmt: skip
            if not offered.each:
                raise picchio.InputError("no drive may be loaded so hard")
        except picchio.InputError as error:
            print(f"{name:24s} left out: {error}", flush=True)
            continue
        planned = [one.deviation for one in choose(outcome, [offered], 1e9, most=12,
                                                   worth=0.0).records]  # fmt: skip
        own = len(picchio.plan(robot, task).records)
        free = at_random(robot, outcome, force, 400, 7)
        space = Space.of(outcome, [free])
        rng = np.random.default_rng(3)
        curves = np.array([along(space, rng.permutation(len(free.each))[:MOST])
                           for _ in range(SEQUENCES)])  # fmt: skip
        middle = np.median(curves, axis=0)
        ratio = {}
        for k in (3, 5, 8, own):
            if 0 < k <= len(planned):
                enough = np.flatnonzero(middle <= planned[k - 1])
                ratio[k] = k / (enough[0] + 1) if len(enough) else 0.0
        row = {"robot": name, "planned": planned, "random": middle.tolist(), "own": own,
               "ratio": ratio}  # fmt: skip
        rows.append(row)
        at = own if own in ratio else 5
        print(f"{name:24s} plan ends at {own:2d}; deviation with 5 planned {planned[4]:.3f}, "
              f"5 random {middle[4]:.3f}, 10 random {middle[9]:.3f}, 20 random {middle[19]:.3f}; "
              f"records over random ones at {at}: {ratio[at]:.2f}", flush=True)  # fmt: skip
    for k in (3, 5, 8):
        share = [row["ratio"][k] for row in rows if k in row["ratio"]]
        print(f"{k} planned: median of records over random ones {np.median(share):.2f}, "
              f"at most half in {100 * np.mean(np.array(share) <= 0.5):.0f} % of "
              f"{len(share)} robots")  # fmt: skip
    share = [row["ratio"][row["own"]] for row in rows if row["own"] in row["ratio"]]
    print(f"where the plan ends: median {np.median(share):.2f} of {len(share)} robots "
          "(0: 40 random ones are not enough)")  # fmt: skip
    return {"expected": rows}


def arms(count: int) -> list[str]:
    """Arms of example-robot-data, by what `picchio robots` lists: 4 to 8 joints, no legs."""
    shipped = {one.name for one in picchio.robots(examples=False)}
    listed = [one for one in picchio.robots() if one.name not in shipped]
    return [one.name for one in listed if 4 <= one.dof <= 8][:count]


@one_thread()
def blind(count: int, first: int) -> dict[str, Any]:
    rows = []
    plans: dict[int, Any] = {}
    lives: dict[int, Life] = {}
    for seed in range(first, first + count):
        size = blind_stiffness.SIZES[seed % 3]
        if size not in plans:
            robot = picchio.load_robot(loads.ROBOTS[size])
            plans[size] = picchio.plan(robot)
            lives[size] = Life.of(robot, task_of(robot))
        plan, life = plans[size], lives[size]
        asked = [
            loads.Asked(plan.robot.pose(one.candidate.pose)[plan.robot.flexible_index],
                        one.candidate.direction, one.candidate.force, one.candidate.reads)
            for one in plan.records
        ]  # fmt: skip
        own = len(asked)
        row = {"robot": loads.ROBOTS[size], "seed": seed, "records": own}
        for name, options in (
            ("planned", {"asked": asked}),
            ("random", {"loadings": own}),
            ("twice", {"loadings": 2 * own}),
        ):
            world = loads.draw(size, seed, gauge=True, **options)
            found = picchio.identify(world.robot, blind_stiffness.campaign(world))
            value = np.log([joint.stiffness.value for joint in found.joints])
            both = np.zeros((2, len(life.covariance)))
            both[:, :size] = np.stack([value, np.log(world.truth)]) - np.log(world.nominal)
            parts = life.parts(both)[1]
            row[name] = float(parts[:, 0].max() - parts[:, 1].max())
        rows.append(row)
        print(f"{row['robot']:16s} {seed} {own:2d} records: error of log peak torque "
              f"{row['planned']:+.3f}, random {row['random']:+.3f}, twice as many "
              f"{row['twice']:+.3f}", flush=True)  # fmt: skip
    for name in ("planned", "random", "twice"):
        size = np.abs([row[name] for row in rows])
        print(f"{name:8s} median {np.median(size):.4f}, rms {np.sqrt(np.mean(size**2)):.4f}, "
              f"90 % below {np.quantile(size, 0.9):.4f}")  # fmt: skip
    return {"blind": rows}


@one_thread()
def real(folder: Path, tens: int) -> dict[str, Any]:
    robot, campaign = picchio.load_robot(loadings.ROBOT), loadings.read(folder)
    task = task_of(robot)
    problem = loadings.problem_of(robot, campaign, campaign.tolerance)
    outcome = outcome_of(robot, task, draws=16, seed=0)
    n, (table,) = problem.joints, problem.tables
    count = len(table)
    slopes = np.zeros((count, len(outcome.at), 3, 2 * n + len(problem.steps)))
    # A tracker's noise and what springs leave: the residual that such data had before, 20 %.
    left = 0.2 * float(np.sqrt(np.mean(table.values**2)))
    for s, drawn in enumerate(outcome.at):
        at = np.zeros(len(problem.precision))
        at[:n] = drawn[:n]
        (part,) = problem.predict(at)
        lower = np.linalg.cholesky(part.own + left**2 * np.eye(3))
        white = np.linalg.solve(lower, part.slope)
        slopes[:, s, :, :n], slopes[:, s, :, 2 * n :] = white[..., :n], white[..., n:]
    each = tuple(Possible("static", k, np.zeros(6), np.zeros(3), 1.0, None, ("tracker",))
                 for k in range(count))  # fmt: skip
    offered = Offered(StaticTest(), each, problem.steps, slopes)
    rows: dict[str, Any] = {}
    every = np.eye(2 * n)[:n] / prior_of(robot).std[:, None]
    aims = {
        "the life": outcome,
        "every joint alike": replace(
            outcome, slope=np.tile(every, (len(outcome.at), 1, 1)), rest=0.0
        ),
    }
    rng = np.random.default_rng(0)
    random = np.array([judged(problem, rng.permutation(count)[:10]) for _ in range(tens)])
    print(f"{tens} random tens: residual over signal on the other {count - 10}: "
          f"median {100 * np.median(random):.1f} %, "
          f"10 % below {100 * np.quantile(random, 0.1):.1f} %")  # fmt: skip
    for words, aim in aims.items():
        chosen = [one.candidate.place for one in choose(aim, [offered], 1e9, most=10,
                                                        worth=0.0).records]  # fmt: skip
        own = judged(problem, np.array(chosen))
        percentile = 100.0 * float(np.mean(random < own))
        print(f"ten chosen for {words}: {100 * own:.1f} %, percentile {percentile:.1f} "
              f"(rows {sorted(k + 2 for k in chosen)})")  # fmt: skip
        rows[words] = {"rows": chosen, "nrmse": own, "percentile": percentile}
    return {"real": rows, "random": random.tolist()}


def judged(problem: Problem, chosen: np.ndarray) -> float:
    """The residual over the signal on the loadings that were not fitted."""
    (table,) = problem.tables
    keep = np.zeros(len(table), bool)
    keep[chosen] = True
    found = climb(problem, np.zeros(len(problem.precision)), 6.0, keep)
    (part,) = problem.predict(found.mean)
    return float(np.sqrt((part.residual[~keep] ** 2).sum() / (table.values[~keep] ** 2).sum()))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--expected", action="store_true")
    parser.add_argument("--examples", action="store_true")
    parser.add_argument("--blind", type=int, default=0)
    parser.add_argument("--first", type=int, default=5000)
    parser.add_argument("--real", type=Path)
    parser.add_argument("--tens", type=int, default=1000)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    start, found = time.process_time(), {}
    if given.expected:
        found |= expected(given.examples)
    if given.blind:
        found |= blind(given.blind, given.first)
    if given.real is not None:
        found |= real(given.real, given.tens)
    print(f"processor time {time.process_time() - start:.0f} s")
    if given.json is not None:
        with atomic_write(given.json) as stream:
            json.dump(found, stream, indent=1)


if __name__ == "__main__":
    main()
