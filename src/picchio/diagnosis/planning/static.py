"""Static loadings that could be taken: a pull or a weight at the tool, a gauge or a tracker."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from picchio.campaign.loadings import Loadings, Reading
from picchio.campaign.tables import Tolerance
from picchio.core.arrays import BoolArray, FloatArray
from picchio.diagnosis.planning.kind import Offered, Possible, Test, angles
from picchio.diagnosis.planning.outcome import Outcome
from picchio.diagnosis.stiffness.fit import Problem
from picchio.diagnosis.stiffness.prior import prior_of
from picchio.diagnosis.stiffness.statics import make_table
from picchio.model.expansion import WideChain
from picchio.robot.flexible_robot import FlexibleRobot

_ASLANT = math.sqrt(0.5)
PULLS = np.array([
    [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [_ASLANT, _ASLANT, 0.0],
    [_ASLANT, -_ASLANT, 0.0], [_ASLANT, 0.0, -_ASLANT], [0.0, _ASLANT, -_ASLANT],
])  # fmt: skip
"""World: what a person can pull along with a cord; the opposite way tells the same."""
AXES = np.eye(3)


class StaticTest(Test):
    """A scale or a weight at the tool, a dial gauge or a tracker."""

    name = "static"
    loads = frozenset({"scale", "weight"})
    reads = frozenset({"dial", "tracker"})
    seconds = (60.0, 30.0, 30.0)
    least = 3
    file = "loads.csv"

    def row(
        self, robot: FlexibleRobot, one: Possible, instruments: Sequence[str]
    ) -> dict[str, object]:
        """As `Test`: the readings are left empty."""
        found: dict[str, object] = {
            f"pose.{name} [{unit}]": value
            for name, (value, unit) in angles(robot, one.pose).items()
        }
        if "scale" in instruments:
            found |= {"pull [N]": round(one.force, 2), **_way("pull_direction", one.direction)}
        else:
            found["weight [N]"] = round(one.force, 2)
        if one.reads is None:
            return found | {f"displacement.{robot.tool_frame}.{axis} [mm]": "" for axis in "xyz"}
        return found | {"dial [mm]": "", **_way("dial_direction", one.reads)}

    def table(self, robot: FlexibleRobot, one: Possible) -> dict[str, object]:
        """As `Test`: the form says it all."""
        return {}

    def candidates(
        self,
        robot: FlexibleRobot,
        poses: FloatArray,
        outcome: Outcome,
        force: float,
        instruments: Sequence[str],
        tolerance: Tolerance,
    ) -> Offered:
        """As `Test`; loads that a drive is not rated for are left out."""
        down = np.array(robot.mounting.gravity, dtype=float)
        pulls = PULLS if "scale" in instruments else down[None] / np.linalg.norm(down)
        place = np.repeat(np.arange(len(poses)), len(pulls))
        way = np.tile(pulls, (len(poses), 1))
        bears = _bears(robot, poses[place], force * way)
        place, way = place[bears], way[bears]
        if not len(place):
            return Offered(self, (), (), np.zeros((0, len(outcome.at), 1, len(outcome.at[0]))))
        axes = np.repeat(AXES[None], len(place), axis=0)
        if "tracker" not in instruments:  # a gauge may read along the pull, too
            axes = np.concatenate([axes, way[:, None]], axis=1)
        slopes, own, names = told(robot, poses[place], force * way, axes, outcome, tolerance)
        if "tracker" in instruments:
            lower = np.linalg.cholesky(own)
            white = np.linalg.solve(lower, slopes).swapaxes(0, 1)
            each = tuple(
                Possible(self.name, int(k), poses[k], d, force, None, ("tracker",))
                for k, d in zip(place, way, strict=True)
            )
            return Offered(self, each, names, white)
        size = np.sqrt(np.diagonal(own, axis1=-2, axis2=-1))
        white = (slopes / size[..., None]).swapaxes(0, 1)[:, :, :, None]
        found, kept = [], []
        for row, (k, d) in enumerate(zip(place, way, strict=True)):
            for reading, axis in enumerate(axes[row]):
                if reading == len(AXES) and np.abs(AXES @ axis).max() > 1.0 - 1e-9:
                    continue  # one of the three
                setting = ("dial", *np.round(axis, 6).tolist())
                found.append(Possible(self.name, int(k), poses[k], d, force, axis, setting))
                kept.append(white[row, :, reading])
        return Offered(self, tuple(found), names, np.array(kept))


def told(
    robot: FlexibleRobot, poses: FloatArray, forces: FloatArray, axes: FloatArray,
    outcome: Outcome, tolerance: Tolerance,
) -> tuple[FloatArray, FloatArray, tuple[str, ...]]:  # fmt: skip
    """What m loadings would tell, at each of the outcome's s drawn robots.

    Args:
        robot: flexible.
        poses: (m, nv) rad or m.
        forces: (m, 3) N, world.
        axes: (m, r, 3) along which gauges at the tool read, world.
        outcome: whose robots they are looked at.
        tolerance: how exact everything is.

    Returns:
        (s, m, r, p) slopes of the readings, m; (s, m, r, r) covariance of what is drawn for each
        loading anew, noise included; names of the numbers behind stiffness and damping.
    """
    m, r = axes.shape[:2]
    readings = tuple(Reading("dial", np.zeros((m, 1)), axes[:, k : k + 1]) for k in range(r))
    names = robot.joint_names
    loadings = Loadings("plan", {name: poses[:, k] for k, name in enumerate(names)}, forces, None,
                        None, readings, None)  # fmt: skip
    table = make_table(robot, WideChain(robot), loadings, tolerance)
    problem = Problem((table,), prior_of(robot), {"dial": tolerance.dial})
    n = problem.joints
    slopes = np.zeros((len(outcome.at), m, r, 2 * n + len(problem.steps)))
    own = np.zeros((len(outcome.at), m, r, r))
    for s, drawn in enumerate(outcome.at):
        at = np.zeros(len(problem.precision))
        at[:n] = drawn[:n]
        (part,) = problem.predict(at)
        slopes[s, ..., :n], slopes[s, ..., 2 * n :] = part.slope[..., :n], part.slope[..., n:]
        assert part.own is not None
        own[s] = part.own + max(tolerance.dial, 1e-9) ** 2 * np.eye(r)
    return slopes, own, problem.steps


def _bears(robot: FlexibleRobot, poses: FloatArray, forces: FloatArray) -> BoolArray:
    """(m,) whether gravity and the load stay within what every rated drive bears."""
    found = np.ones(len(poses), dtype=bool)
    for row, (pose, force) in enumerate(zip(poses, forces, strict=True)):
        state = robot.state(pose)
        held = state.gravity_torque
        peak = np.abs(held) + np.abs(state.jacobian.T @ force)
        for k, joint in enumerate(robot.flexible_joints):
            if joint.ratings is not None:
                shares = joint.ratings.shares(peak[k], np.abs(held[k]))
                found[row] &= all(share <= 1.0 for share in shares.values())
    return found


def _way(name: str, direction: FloatArray) -> dict[str, object]:
    return {f"{name}.{axis}": round(float(x), 6) + 0.0
            for axis, x in zip("xyz", direction, strict=True)}  # fmt: skip
