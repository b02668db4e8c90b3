"""What an ideal sensor of each kind reads, from the motion of the coordinates."""

from __future__ import annotations

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.model.expansion import Motion
from picchio.model.system import VibratingSystem
from picchio.vibration.integration.integrate import CoordinateMotion


def reading(
    kind: str,
    subject: str | None,
    system: VibratingSystem,
    motion: CoordinateMotion,
) -> FloatArray:
    """The readings of a kind of channel, to second order in the deflection.

    Args:
        kind: "deflection", or a frame's "displacement", "velocity", "acceleration"
            (world axes) or "accelerometer" (R^T (a - g), less its value at rest).
        subject: the frame, where the kind has one.
        system: gives the kinematics.
        motion: of the coordinates, (k, N) each.

    Returns:
        (n, k) for all joints, or (3, k) for a frame's axes; SI.

    Raises:
        InputError: a kind that is none of these, a frame that the robot does not have.
    """
    if kind == "deflection":
        return np.asarray(system.deflections @ motion.position.T)
    frame = system.geometry.motion(subject or "", system.taken)
    wide = list(system.wide)
    whole = (motion.position, motion.velocity, motion.acceleration)
    x, v, a = (part if len(wide) == part.shape[1] else part[:, wide] for part in whole)
    if kind == "displacement":
        return _linear(frame, x) + 0.5 * _bilinear(frame, x, x)
    if kind == "velocity":
        return _linear(frame, v) + _bilinear(frame, x, v)
    if kind not in ("acceleration", "accelerometer"):
        raise InputError("cannot be predicted", key="channel", value=kind)
    from picchio.prediction.reading_kernel import felt, frame_acceleration

    x, v, a = (np.ascontiguousarray(part) for part in (x, v, a))
    jacobian, gradient = np.ascontiguousarray(frame.jacobian), frame.gradient
    acceleration = np.empty((3, x.shape[0]))
    frame_acceleration(jacobian, gradient, x, v, a, acceleration)
    if kind == "acceleration":
        return acceleration
    gravity = np.array(system.geometry.robot.mounting.gravity, dtype=float)
    rotation = np.ascontiguousarray(frame.rotation)
    out = np.empty_like(acceleration)
    felt(jacobian, gradient, rotation, gravity, x, acceleration, out)
    return out


def _linear(frame: Motion, values: FloatArray) -> FloatArray:
    return np.asarray(frame.jacobian[:3] @ values.T)


def _bilinear(frame: Motion, first: FloatArray, second: FloatArray) -> FloatArray:
    """(3, k): the Jacobian's change along `first`, times `second`."""
    n = first.shape[1]
    flat = frame.gradient[:, :3].transpose(1, 0, 2).reshape(3, n * n)
    return np.asarray(flat @ (first[:, :, None] * second[:, None, :]).reshape(-1, n * n).T)
