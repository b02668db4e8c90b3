"""What an ideal sensor of each kind reads, from the motion of the coordinates."""

from __future__ import annotations

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.model.system import VibratingSystem
from picchio.robot.expansion import Motion
from picchio.vibration.integrate import CoordinateMotion


def reading(
    kind: str,
    subject: str | None,
    system: VibratingSystem,
    motion: CoordinateMotion,
    force: FloatArray,
) -> FloatArray:
    """The readings of a kind of channel, to second order in the deflection.

    Args:
        kind: "force", "deflection", or a frame's "displacement", "velocity", "acceleration"
            (world axes) or "accelerometer" (R^T (a - g), less its value at rest).
        subject: the frame, where the kind has one.
        system: gives the kinematics.
        motion: of the coordinates, (k, N) each.
        force: (k,) N, of the tool.

    Returns:
        (1, k), (n, k) for all joints, or (3, k) for a frame's axes; SI.

    Raises:
        InputError: a kind that is none of these, a frame that the robot does not have.
    """
    if kind == "force":
        return force[None]
    if kind == "deflection":
        return np.asarray(system.deflections @ motion.position.T)
    frame = system.geometry.motion(subject or "").take(list(system.taken))
    wide = list(system.wide)
    x, v, a = (part[:, wide] for part in (motion.position, motion.velocity, motion.acceleration))
    if kind == "displacement":
        return _linear(frame, x) + 0.5 * _bilinear(frame, x, x)
    if kind == "velocity":
        return _linear(frame, v) + _bilinear(frame, x, v)
    if kind not in ("acceleration", "accelerometer"):
        raise InputError("cannot be predicted", key="channel", value=kind)
    acceleration = _linear(frame, a) + _bilinear(frame, x, a) + _bilinear(frame, v, v)
    if kind == "acceleration":
        return acceleration
    gravity = np.asarray(system.geometry.robot.mounting.gravity, dtype=float)
    # How the frame has turned since rest, as a rotation vector in the world.
    turn = frame.jacobian[3:] @ x.T + 0.5 * _angular(frame, x)
    felt = acceleration.T - gravity
    once = np.cross(turn.T, felt)
    # R^T f = R0^T exp(-[turn]) f, to second order; g has been felt at rest already.
    seen = felt - once + 0.5 * np.cross(turn.T, once) + gravity
    return np.asarray(frame.rotation.T @ seen.T)


def _linear(frame: Motion, values: FloatArray) -> FloatArray:
    return np.asarray(frame.jacobian[:3] @ values.T)


def _bilinear(frame: Motion, first: FloatArray, second: FloatArray) -> FloatArray:
    """(3, k): the Jacobian's change along `first`, times `second`."""
    n = first.shape[1]
    flat = frame.gradient[:, :3].transpose(1, 0, 2).reshape(3, n * n)
    return np.asarray(flat @ (first[:, :, None] * second[:, None, :]).reshape(-1, n * n).T)


def _angular(frame: Motion, x: FloatArray) -> FloatArray:
    n = x.shape[1]
    flat = frame.gradient[:, 3:].transpose(1, 0, 2).reshape(3, n * n)
    return np.asarray(flat @ (x[:, :, None] * x[:, None, :]).reshape(-1, n * n).T)
