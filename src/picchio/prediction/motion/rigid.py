"""From a log to the motion that the model sees: filtered, differentiated, with its torques."""

from __future__ import annotations

from functools import cache

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.model.motion import Motion
from picchio.prediction.motion.filters import Band
from picchio.prediction.motion.log import MotionLog
from picchio.robot.dynamics.statics import balancing
from picchio.robot.flexible_robot import FlexibleRobot

_STILL = 0.01  # of the fastest


def rigid_motion(robot: FlexibleRobot, log: MotionLog, band: Band) -> Motion:
    """The record's motion and the torques that its rigid bodies take, by Pinocchio.

    Angles and what follows from them are low-passed in `band`. Joints that were not recorded
    stand at zero.

    Args:
        robot: masses and geometry.
        log: the record.
        band: where to filter.
    """
    q = {joint: band.low_pass(angle) for joint, angle in log.angle.items()}
    v = {joint: band.differentiate(x) for joint, x in q.items()}
    a = {joint: band.differentiate(x) for joint, x in v.items()}
    poses, velocities, accelerations = (_stack(robot, x, log.samples) for x in (q, v, a))
    torque = robot.rigid.inverse_dynamics(poses, velocities, accelerations)
    _balance(robot, poses, torque)
    index = {joint: i for i, joint in enumerate(robot.joint_names)}

    @cache
    def tool_load() -> dict[str, FloatArray]:
        frame = robot.rigid.frame(robot.tool_frame)
        load = robot.rigid.point_load(poses, velocities, accelerations, frame)
        return {joint: load[:, index[joint]] for joint in q}

    stiffness = dict(zip(robot.flexible_names, robot.stiffness, strict=True))
    ratio = {joint.name: joint.gear_ratio for joint in robot.flexible_joints}
    return Motion(
        rate=log.rate,
        angle=q,
        velocity=v,
        acceleration=a,
        still={joint: _still(log, band, joint, x) for joint, x in v.items()},
        body={joint: torque[:, index[joint]] for joint in q},
        stiffness={joint: float(k) for joint, k in stiffness.items()},
        gear_ratio={joint: abs(ratio.get(joint) or 1.0) for joint in q},
        tool_load=tool_load,
    )


def _stack(robot: FlexibleRobot, series: dict[str, FloatArray], samples: int) -> FloatArray:
    zero = np.zeros(samples)
    return np.column_stack([series.get(joint, zero) for joint in robot.joint_names])


def _balance(robot: FlexibleRobot, poses: FloatArray, torque: FloatArray) -> None:
    """Add what gravity balancers that the sidecar states leave to the drives."""
    if any(joint.balancer is not None for joint in robot.flexible_joints):
        flexible = robot.flexible_index
        for pose, row in zip(poses, torque, strict=True):
            row[flexible] += balancing(robot.flexible_joints, robot.tree, pose[flexible])[0]


def _still(log: MotionLog, band: Band, joint: str, velocity: FloatArray) -> float:
    """A hundredth of the fastest, or what the encoder's noise alone makes of a standing joint."""
    noise = angle_noise(log.angle[joint]) * np.sqrt(2.0 * band.cutoff / log.rate)
    return max(_STILL * float(np.abs(velocity).max()),
               3.0 * noise * 2.0 * np.pi * band.cutoff / np.sqrt(3.0))  # fmt: skip


def angle_noise(series: FloatArray) -> float:
    """Standard deviation of an encoder's noise, from fourth differences, which motion lacks."""
    if series.size < 16:
        return 0.0
    fourth = np.diff(series, 4)
    # Var of the fourth difference of white noise: 1 + 16 + 36 + 16 + 1 = 70.
    return float(1.4826 * np.median(np.abs(fourth)) / np.sqrt(70.0))
