"""Compiled peaks over time, and over all directions, for many poses."""

from __future__ import annotations

import numpy as np
from numba import njit

from picchio.vibration.batch.modal_kernel import (
    KERNEL,
    coefficients,
    decompose,
    exponential,
    modes_of,
)
from picchio.vibration.batch.top_kernel import (
    TERMS,
    highest,
    joint_norms,
    power_series,
    room_for,
    sample,
    samples_of,
)

# So many matrices are decomposed side by side; more would not stay near the processor.
_BLOCK = 64
SPAN = 8 * _BLOCK  # poses that a thread takes at a time


@njit(**KERNEL)
def _pulls(jacobian, along, shapes, pull):  # type: ignore[no-untyped-def]
    """Fill (n, n, 4): of a joint, by a mode, for each axis of the force; and the length of that.

    With a fixed direction, `along` (3,), all is on the first axis.
    """
    n = shapes.shape[0]
    for i in range(n):
        x, y, z = 0.0, 0.0, 0.0
        for j in range(n):
            shape = shapes[j, i]
            x += jacobian[0, j] * shape
            y += jacobian[1, j] * shape
            z += jacobian[2, j] * shape
        if along.shape[0] > 0:
            x, y, z = x * along[0] + y * along[1] + z * along[2], 0.0, 0.0
        size = np.sqrt(x * x + y * y + z * z)
        for j in range(n):
            shape = shapes[j, i]
            pull[j, i, 0], pull[j, i, 1], pull[j, i, 2] = shape * x, shape * y, shape * z
            pull[j, i, 3] = abs(shape) * size


@njit(**KERNEL)
def _pose_peaks(  # type: ignore[no-untyped-def]
    periodic, start, length, constant, slope, amplitude, wave, endless, omega, poles, rows, powers,
    pull, g, free, terms, room, peak, direction,
):  # fmt: skip
    """Peaks (n,) and their directions (n, 3) at a pose; or how many samples need room first."""
    n = poles.shape[0]
    while True:
        count, total = samples_of(length, wave, omega[n - 1])
        if count > room.time.shape[0]:
            break
        sample(poles, rows, length, wave, omega[n - 1], room)
        done = True
        for j in range(n):
            peak[j] = joint_norms(j, count, pull[j], room)
            if endless and done:
                # Nothing after the samples can be larger than what is left of the modes.
                left = 0.0
                for d in range(3):
                    most = 0.0
                    for i in range(n):
                        state = rows[i, -1, 0] * exponential(poles[i], length[-1])
                        most += abs(pull[j, i, d]) * abs(state) / poles[i].imag
                    left += most * most
                done = left <= peak[j]
        if done or length[-1] > -1e3 * np.pi / poles[0].real:
            break
        length[-1] *= 2.0
    if count > room.time.shape[0]:
        return count
    for j in range(n):
        direction[j, 0], direction[j, 1], direction[j, 2] = 0.0, 0.0, 1.0
        if peak[j] > 0.0:
            peak[j] = highest(
                j, count, periodic, total, peak[j], room, start, poles, rows, constant, slope,
                amplitude, wave, powers, pull[j], g, free, terms, direction,
            )  # fmt: skip
    return 0


@njit(cache=True, error_model="numpy", forceinline=True)
def _block_peaks(  # type: ignore[no-untyped-def]
    first, last, periodic, start, duration, constant, slope, amplitude, wave, mass, jacobian,
    stiffness, joint_ratio, along, frequency, peak, direction,
):  # fmt: skip
    """`peaks` of one block.

    A function of its own: as one loop over the blocks it takes 15 % longer.
    """
    n = stiffness.shape[1]
    fixed = along.shape[0] > 0
    omega, shapes, pull = np.empty(n), np.empty((n, n)), np.empty((n, n, 4))
    g, terms, free, powers = (
        np.empty(3),
        np.empty((TERMS, 3)),
        np.empty((n, 2)),
        np.empty((TERMS, n, 2)),
    )
    room = room_for(n, 256)
    poles = np.empty(n, dtype=np.complex128)
    rows = np.empty((n, duration.shape[0], 7), dtype=np.complex128)
    endless, length, nothing = np.isinf(duration[-1]), duration.copy(), np.empty(0)
    values, vectors = np.empty((n, n, last - first)), np.empty((n, n, last - first))
    decompose(mass[first:last], stiffness[first:last], values, vectors)
    for s in range(first, last):
        if not modes_of(
            s - first, values, vectors, stiffness[s], joint_ratio, omega, shapes, frequency[s],
            poles,
        ):  # fmt: skip
            continue
        _pulls(jacobian[s], along[s] if fixed else nothing, shapes, pull)
        power_series(poles, powers)
        coefficients(poles, duration, constant, slope, amplitude, wave, periodic, rows)
        if endless:
            length[-1] = 2.0 * np.pi / omega[0]
        while True:
            more = _pose_peaks(
                periodic, start, length, constant, slope, amplitude, wave, endless, omega,
                poles, rows, powers, pull, g, free, terms, room, peak[s], direction[s],
            )  # fmt: skip
            if more == 0:
                break
            room = room_for(n, 2 * more)
        if fixed:
            for j in range(n):
                for d in range(3):
                    direction[s, j, d] = along[s, d]


@njit(cache=True, nogil=True, error_model="numpy")
def peaks(  # type: ignore[no-untyped-def]
    first, last, periodic, start, duration, constant, slope, amplitude, wave, mass, jacobian,
    stiffness, joint_ratio, along, frequency, peak, direction,
):  # fmt: skip
    """Natural frequencies and peak deflections at many poses.

    Args:
        first: of the poses; a multiple of how many are decomposed side by side.
        last: the one after the last.
        periodic: steady state, or from rest with an endless last piece.
        start: (m,) s, of the pieces of the force; see `PiecewiseForce` for these.
        duration: (m,) s.
        constant: (m,) N.
        slope: (m,) N/s.
        amplitude: (m,) complex, N.
        wave: (m,) rad/s.
        mass: (p, n, n) kg m^2.
        jacobian: (p, 3, n) m.
        stiffness: (p, n) N m/rad.
        joint_ratio: (n,) damping ratios.
        along: (p, 3) force directions, or (0, 3) for the worst of all directions.
        frequency: (p, n) Hz, NaN, out; left so where the mass matrix is not positive definite.
        peak: (p, n) rad, NaN, out; left so where a mode is not underdamped: take the exact
            path there.
        direction: (p, n, 3) out; of a fixed direction, itself.
    """
    for begin in range(first, last, _BLOCK):
        _block_peaks(
            begin, min(last, begin + _BLOCK), periodic, start, duration, constant, slope,
            amplitude, wave, mass, jacobian, stiffness, joint_ratio, along, frequency, peak,
            direction,
        )  # fmt: skip
