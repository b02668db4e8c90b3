"""Damage and extremes of one rivet at many poses, in compiled code."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from picchio.core.arrays import FloatArray
from picchio.excitation.excitation import Excitation
from picchio.fatigue.sn.curve import SNCurve
from picchio.model.model import Model
from picchio.robot.dynamics.statics import balancing
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.studies.rivet.life_rules import RainflowRule
from picchio.studies.rivet.loads import loads_at
from picchio.studies.tasks import Operation


@dataclass(frozen=True, eq=False)
class BatchDamage:
    """One rivet from rest, ring-down included, at p poses of n joints.

    Attributes:
        natural_frequencies: (p, n) Hz; NaN where the mass matrix is not positive definite.
        lowest: (p, n) rad, smallest deflection.
        highest: (p, n) rad, largest deflection.
        stiffness: (p, n) N m/rad, of the joints there.
        damage: (p, n) Miner's sum; NaN for a joint without a curve.
    """

    natural_frequencies: FloatArray
    lowest: FloatArray
    highest: FloatArray
    stiffness: FloatArray
    damage: FloatArray

    @property
    def amplitude(self) -> FloatArray:
        """(p, n) N m, half of the torque's largest range: rainflow's largest amplitude."""
        return 0.5 * self.stiffness * (self.highest - self.lowest)


def batch_damage(
    robot: FlexibleRobot,
    poses: FloatArray,
    direction: ArrayLike,
    excitation: Excitation,
    hits: int,
    curves: Sequence[SNCurve | None],
    *,
    compiled: bool = True,
) -> BatchDamage:
    """What one rivet does at many poses: the default method of `assess` without its report.

    Args:
        robot: with stiffnesses; gravity stiffness is off.
        poses: (p, nv) rad or m, taken unchecked.
        direction: (3,) or (p, 3) unit vectors of the force, world.
        excitation: the blows.
        hits: of a rivet.
        curves: of the n joints; None without a shaft.
        compiled: False takes the path of `assess` throughout: the oracle.

    Raises:
        InputError: no hits, or a mode without damping.
    """
    force = excitation.burst(hits)
    along = np.ascontiguousarray(np.broadcast_to(direction, (len(poses), 3)), dtype=float)
    n = len(robot.flexible_joints)
    springs = stiffness_at(robot, poses)
    found = BatchDamage(
        np.full((len(poses), n), np.nan), np.full((len(poses), n), np.nan),
        np.full((len(poses), n), np.nan), springs, np.zeros((len(poses), n)),
    )  # fmt: skip
    left = np.ones(len(poses), dtype=bool)
    if compiled:
        from picchio.studies.rivet.damage_kernel import damages

        mass, jacobian = robot.mass_and_jacobian(poses)
        damages(
            force.start, force.duration, force.constant, force.slope, force.amplitude,
            force.angular_frequency, np.ascontiguousarray(mass), np.ascontiguousarray(jacobian),
            springs, robot.damping_ratio, along, stress_per_torque(robot), *curve_tables(curves),
            found.natural_frequencies, found.lowest, found.highest, found.damage,
        )  # fmt: skip
        left = np.isnan(found.lowest[:, 0]) & ~np.isnan(found.natural_frequencies[:, 0])
    for s in np.flatnonzero(left):
        operation = Operation("", along[s], excitation, hits, poses[s : s + 1])
        _exactly(robot, operation, curves, found, int(s))
    found.damage[:, [curve is None for curve in curves]] = np.nan
    return found


def _exactly(
    robot: FlexibleRobot,
    operation: Operation,
    curves: Sequence[SNCurve | None],
    found: BatchDamage,
    s: int,
) -> None:
    """One pose by the path that takes every damping."""
    loads = loads_at(Model(robot), operation, operation.poses[0], need="rest")
    found.natural_frequencies[s] = loads.natural_frequencies
    for j, (joint, load) in enumerate(zip(robot.flexible_joints, loads.joints, strict=True)):
        assert load.rest is not None
        found.lowest[s, j], found.highest[s, j] = load.rest.min(), load.rest.max()
        curve = curves[j]
        if curve is not None:
            rule = RainflowRule()
            found.damage[s, j] = rule(joint, load, operation.hits_per_rivet, curve).damage


def gravity_torque_at(robot: FlexibleRobot, poses: FloatArray) -> FloatArray:
    """Torque (p, n) that the springs carry at rest at poses (p, nv), unchecked, N m (N)."""
    index = robot.flexible_index
    held = np.array([robot.rigid.gravity_torque(pose) for pose in poses])
    held = held.reshape(len(poses), len(robot.joint_names))[:, index]
    if any(joint.balancer is not None for joint in robot.flexible_joints):
        rows = poses[:, index]
        added = [balancing(robot.flexible_joints, robot.tree, row)[0] for row in rows]
        held = held + np.array(added).reshape(held.shape)
    return np.asarray(held)


def stiffness_at(robot: FlexibleRobot, poses: FloatArray) -> FloatArray:
    """Stiffness (p, n) of the joints at poses (p, nv), N m/rad; curves at gravity's torque."""
    springs = np.tile(robot.stiffness, (len(poses), 1))
    curves = [joint.stiffness_curve for joint in robot.flexible_joints]
    if any(curve is not None for curve in curves):
        held = gravity_torque_at(robot, poses)
        for j, curve in enumerate(curves):
            if curve is not None:
                springs[:, j] = curve.tangent(held[:, j])
    return springs


def stress_per_torque(robot: FlexibleRobot) -> FloatArray:
    """(n,) 1/m^3: r / Jp of every joint's shaft; zero without one."""
    return np.array(
        [j.shaft.radius / j.shaft.polar_moment if j.shaft else 0.0 for j in robot.flexible_joints]
    )


def curve_tables(
    curves: Sequence[SNCurve | None],
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """The curves as the compiled code takes them: `enough`, `knots`, `lines`, `known`."""
    most = max((len(c.knees) for c in curves if c is not None), default=0)
    enough = np.full(len(curves), np.inf)
    knots = np.zeros((len(curves), most))
    lines = np.ones((len(curves), most + 1, 3))
    known = np.full(len(curves), -1)
    for j, curve in enumerate(curves):
        if curve is None:
            continue
        knees, slopes = np.array(curve.knees), list(curve.slopes)
        at = curve.amplitude(knees) if len(knees) else np.empty(0)
        if len(knees) == len(slopes):  # beyond the last knee lies the endurance limit
            last = slopes[-1]
            slopes.append(
                {"elementary": last, "haibach": 2.0 * last - 1.0}.get(curve.miner, np.inf)
            )
        count = len(at)
        known[j], knots[j, :count] = count, at
        if count:
            # A line is anchored at the knee it ends in; the last one at the knee it starts from.
            ends = [*range(count), count - 1]
            lines[j, : count + 1, 0], lines[j, : count + 1, 1] = knees[ends], at[ends]
        else:
            lines[j, 0, :2] = curve.cycles, curve.strength
        lines[j, : count + 1, 2] = slopes
        enough[j] = at[-1] if np.isinf(slopes[-1]) else -1.0
    return enough, knots, lines, known
