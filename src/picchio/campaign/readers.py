"""What an ideal sensor of each kind reads, from the blows and the motion that they make."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.excitation.piecewise import PiecewiseForce
from picchio.model.swept import Motion
from picchio.model.system import VibratingSystem
from picchio.vibration.integration.integrate import CoordinateMotion, Samples


@dataclass(frozen=True, eq=False)
class Reading:
    """What a reader may look at; force and motion are made when they are asked for.

    Attributes:
        subject: the frame, where the kind is a frame's.
        samples: when.
        force: () -> the tool's force along the blow.
        motion: () -> the kinematics, and the motion of the coordinates, (samples, N) each.
        place: (3,) m, from the frame's origin to the sensor, in the frame's axes; None: there.
    """

    subject: str | None
    samples: Samples
    force: Callable[[], PiecewiseForce]
    motion: Callable[[], tuple[VibratingSystem, CoordinateMotion]]
    place: FloatArray | None = None

    def frame(self) -> tuple[Motion, FloatArray, FloatArray, FloatArray]:
        """The subject's kinematics, and position, velocity, acceleration of its coordinates.

        Raises:
            InputError: a frame that the robot does not have.
        """
        system, motion = self.motion()
        found = system.geometry.motion(self.subject or "", system.taken)
        if self.place is not None:
            found = found.at(self.place)
        wide = list(system.wide)
        whole = (motion.position, motion.velocity, motion.acceleration)
        x, v, a = (part if len(wide) == part.shape[1] else part[:, wide] for part in whole)
        return found, x, v, a


Reader = Callable[[Reading], FloatArray]
"""Of a kind with axes (3, samples); of one of joints (flexible joints, samples); else (1, samples).

To second order in the deflection, in the kind's first SI unit.
"""


def force(reading: Reading) -> FloatArray:
    """The tool's force along the blow, N."""
    history, times = reading.force(), reading.samples.times
    return history(np.mod(times, history.end) if np.isfinite(history.end) else times)[None]


def deflection(reading: Reading) -> FloatArray:
    """Link side minus motor side of every flexible joint, rad or m."""
    system, motion = reading.motion()
    return np.asarray(system.deflections @ motion.position.T)


def displacement(reading: Reading) -> FloatArray:
    """Of the frame's origin since rest, world axes, m."""
    frame, x, _, _ = reading.frame()
    return _linear(frame, x) + 0.5 * _bilinear(frame, x, x)


def velocity(reading: Reading) -> FloatArray:
    """Of the frame's origin, world axes, m/s.

    Args:
        reading: the record's motion at a frame.
    """
    frame, x, v, _ = reading.frame()
    return _linear(frame, v) + _bilinear(frame, x, v)


def acceleration(reading: Reading) -> FloatArray:
    """Of the frame's origin, world axes, m/s^2."""
    return _acceleration(*reading.frame())[0]


def accelerometer(reading: Reading) -> FloatArray:
    """What a sensor of gravity feels, the frame's axes: R^T (a - g), less its value at rest."""
    from picchio.campaign.reading_kernel import felt

    frame, x, v, a = reading.frame()
    found, jacobian, x = _acceleration(frame, x, v, a)
    gravity = np.array(reading.motion()[0].geometry.robot.mounting.gravity, dtype=float)
    out = np.empty_like(found)
    felt(jacobian, frame.gradient, np.ascontiguousarray(frame.rotation), gravity, x, found, out)
    return out


def _acceleration(
    frame: Motion, x: FloatArray, v: FloatArray, a: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(3, k) m/s^2; and the Jacobian and the position as kernels take them."""
    from picchio.campaign.reading_kernel import frame_acceleration

    x, v, a = (np.ascontiguousarray(part) for part in (x, v, a))
    jacobian = np.ascontiguousarray(frame.jacobian)
    out = np.empty((3, x.shape[0]))
    frame_acceleration(jacobian, frame.gradient, x, v, a, out)
    return out, jacobian, x


def _linear(frame: Motion, values: FloatArray) -> FloatArray:
    return np.asarray(frame.jacobian[:3] @ values.T)


def _bilinear(frame: Motion, first: FloatArray, second: FloatArray) -> FloatArray:
    """(3, k): the Jacobian's change along `first`, times `second`."""
    n = first.shape[1]
    flat = frame.gradient[:, :3].transpose(1, 0, 2).reshape(3, n * n)
    return np.asarray(flat @ (first[:, :, None] * second[:, None, :]).reshape(-1, n * n).T)
