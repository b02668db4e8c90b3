"""Residuals as an engineer looks for causes in them: as joint torques, and as transfer functions.

Sources: restoring-force surfaces, Masri and Caughey, J. Appl. Mech. 46 (1979); the H1 estimator,
Bendat and Piersol, Random Data (2010), ch. 6.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError

# Of the highest natural frequency: what lies above is noise made large by differentiation.
_KEPT = 2.5
_SEGMENT = 0.6  # s
_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class Restoring:
    """A joint's torque that the model does not have, beside the joint's motion.

    Attributes:
        deflection: (m,) rad or m, as measured.
        velocity: (m,) 1/s of it.
        torque: (m,) N m or N: what would have to act on the model for it to move as measured.
    """

    deflection: FloatArray
    velocity: FloatArray
    torque: FloatArray


def residual_torque(
    mass: FloatArray,
    damping: FloatArray,
    stiffness: FloatArray,
    measured: FloatArray,
    predicted: FloatArray,
    step: float,
) -> list[Restoring]:
    """The generalised torque that makes up for the difference of two motions of a linear model.

    With e = measured - predicted it is M e'' + C e' + K e, derivatives by differences after a
    zero-phase low-pass above the highest natural frequency. The edges of the record are left out.

    Args:
        mass: (n, n).
        damping: (n, n).
        stiffness: (n, n).
        measured: (n, m) rad or m.
        predicted: (n, m) rad or m.
        step: s.

    Returns:
        one a joint.

    Raises:
        InputError: fewer than 64 samples.
    """
    from scipy.signal import butter, sosfiltfilt

    if measured.shape[1] < 64:
        raise InputError("too short a record to differentiate", value=measured.shape[1])
    squared = np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real
    highest = float(np.sqrt(max(squared.max(), 0.0))) / (2.0 * np.pi)
    corner = min(_KEPT * highest * step * 2.0, 0.8)
    low = butter(4, corner, output="sos")
    smooth = sosfiltfilt(low, measured, axis=1)
    e = sosfiltfilt(low, measured - predicted, axis=1)
    rate, e1 = np.gradient(smooth, step, axis=1), np.gradient(e, step, axis=1)
    torque = mass @ np.gradient(e1, step, axis=1) + damping @ e1 + stiffness @ e
    edge = min(int(1.5 / corner) + 2, measured.shape[1] // 8)
    kept = slice(edge, -edge)
    return [
        Restoring(x[kept], v[kept], t[kept]) for x, v, t in zip(smooth, rate, torque, strict=True)
    ]


@dataclass(frozen=True, eq=False)
class Transfer:
    """Response over force.

    Attributes:
        frequency: (k,) Hz.
        measured, simulated: (k,) complex, SI a newton.
        coherence: (k,) of the measurement, 0 to 1.
    """

    frequency: FloatArray
    measured: NDArray[np.complex128]
    simulated: NDArray[np.complex128]
    coherence: FloatArray


def transfer(
    force: Sequence[FloatArray],
    measured: Sequence[FloatArray],
    simulated: Sequence[FloatArray],
    step: float,
) -> Transfer:
    """H1 of several records together, the simulation through the same estimator.

    Two or more records are averaged whole: each begins at rest and has rung down, so no window
    is needed. A single one is cut into overlapping windows.

    Args:
        force: (m,) N each, as measured.
        measured: (m,) SI each.
        simulated: (m,) SI each.
        step: s.
    """
    from scipy.signal import csd, welch

    shortest = min(row.size for row in force)
    if len(force) > 1:
        options = {"window": "boxcar", "nperseg": shortest, "noverlap": 0, "detrend": False}
    else:
        size = max(min(int(_SEGMENT / step), shortest // 2), 16)
        options = {"nperseg": size, "noverlap": (3 * size) // 4, "detrend": "constant"}
    options["fs"] = 1.0 / step
    sums: list[NDArray[np.complex128]] = []
    frequency = np.zeros(0)
    for rows in zip(force, measured, simulated, strict=True):
        f, y, s = (row[:shortest] for row in rows)
        frequency, ff = welch(f, **options)
        parts = [ff, welch(y, **options)[1], csd(f, y, **options)[1], csd(f, s, **options)[1]]
        sums = [a + p for a, p in zip(sums, parts, strict=True)] if sums else parts
    power, response = np.maximum(sums[0].real, _TINY), np.maximum(sums[1].real, _TINY)
    coherence = np.abs(sums[2]) ** 2 / (power * response)
    return Transfer(frequency, sums[2] / power, sums[3] / power, np.clip(coherence, 0.0, 1.0))
