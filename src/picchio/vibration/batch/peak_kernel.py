"""Compiled peaks over time, and over all directions, for many poses."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from picchio.core.arrays import ComplexArray, FloatArray
from picchio.vibration.batch.modal_kernel import (
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
    steps_of,
)

# So many matrices are decomposed side by side; more would not stay near the processor.
_BLOCK = 64


@njit(cache=True, error_model="numpy", forceinline=True)
def _block_peaks(  # type: ignore[no-untyped-def]
    first, last, periodic, start, duration, constant, slope, amplitude, wave, mass, jacobian,
    stiffness, joint_ratio, along, frequency, peak, direction,
):  # fmt: skip
    """`peaks` of the poses from `first` to `last` - 1.

    A function of its own, so that the compiler's slow passes for parallel loops never see it.
    """
    n = stiffness.shape[1]
    dims = 3 if along.shape[0] == 0 else 1
    values, vectors = np.empty((n, n, last - first)), np.empty((n, n, last - first))
    decompose(mass[first:last], stiffness[first:last], values, vectors)
    omega = np.empty(n)
    shapes = np.empty((n, n))
    pull = np.empty((n, n, 4))  # of a joint, by a mode, for an axis of the force; and its length
    found = np.empty((n, 3))
    g = np.empty(3)
    terms, free, powers = np.empty((TERMS, 3)), np.empty((n, 2)), np.empty((TERMS, n, 2))
    room = room_for(n, 256)
    poles = np.empty(n, dtype=np.complex128)
    rows = np.empty((n, duration.shape[0], 7), dtype=np.complex128)
    endless, length = np.isinf(duration[-1]), duration.copy()
    for s in range(first, last):
        frequency[s, :] = np.nan
        peak[s, :] = np.nan
        direction[s, :, :] = np.nan
        if not modes_of(
            s - first, values, vectors, stiffness[s], joint_ratio, omega, shapes, frequency[s],
            poles,
        ):  # fmt: skip
            continue
        for i in range(n):
            x, y, z = 0.0, 0.0, 0.0
            for j in range(n):
                shape = shapes[j, i]
                x += jacobian[s, 0, j] * shape
                y += jacobian[s, 1, j] * shape
                z += jacobian[s, 2, j] * shape
            if dims == 1:
                x, y, z = x * along[s, 0] + y * along[s, 1] + z * along[s, 2], 0.0, 0.0
            size = np.sqrt(x * x + y * y + z * z)
            for j in range(n):
                shape = shapes[j, i]
                pull[j, i, 0], pull[j, i, 1], pull[j, i, 2] = shape * x, shape * y, shape * z
                pull[j, i, 3] = abs(shape) * size
        power_series(poles, powers)
        coefficients(poles, duration, constant, slope, amplitude, wave, periodic, rows)
        if endless:
            length[-1] = 2.0 * np.pi / omega[0]
        while True:
            count, total = 0, 0.0
            for p in range(length.shape[0]):
                count += steps_of(length[p], max(omega[n - 1], wave[p]))
                total += length[p]
            if count > room.time.shape[0]:
                room = room_for(n, 2 * count)
            sample(poles, rows, length, wave, omega[n - 1], room)
            done = True
            for j in range(n):
                peak[s, j] = joint_norms(j, count, pull[j], room)
                if endless and done:
                    # Nothing after the samples can be larger than what is left of the modes.
                    left = 0.0
                    for d in range(dims):
                        most = 0.0
                        for i in range(n):
                            state = rows[i, -1, 0] * exponential(poles[i], length[-1])
                            most += abs(pull[j, i, d]) * abs(state) / poles[i].imag
                        left += most * most
                    done = left <= peak[s, j]
            if done or length[-1] > -1e3 * np.pi / poles[0].real:
                break
            length[-1] *= 2.0
        for j in range(n):
            found[j, 0], found[j, 1], found[j, 2] = 0.0, 0.0, 1.0
            if peak[s, j] > 0.0:
                peak[s, j] = highest(
                    j, count, periodic, total, peak[s, j], room, start, poles, rows, constant,
                    slope, amplitude, wave, powers, pull[j], g, free, terms, found,
                )  # fmt: skip
        for j in range(n):
            for d in range(3):
                direction[s, j, d] = found[j, d] if dims == 3 else along[s, d]


@njit(cache=True, parallel=True, error_model="numpy")
def peaks(
    periodic: bool,
    start: FloatArray,
    duration: FloatArray,
    constant: FloatArray,
    slope: FloatArray,
    amplitude: ComplexArray,
    wave: FloatArray,
    mass: FloatArray,
    jacobian: FloatArray,
    stiffness: FloatArray,
    joint_ratio: FloatArray,
    along: FloatArray,
    frequency: FloatArray,
    peak: FloatArray,
    direction: FloatArray,
) -> None:
    """Natural frequencies and peak deflections at many poses.

    Args:
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
        frequency: (p, n) Hz, out; NaN where the pose's mass matrix is not positive definite.
        peak: (p, n) rad, out; NaN where a mode is not underdamped: take the exact path there.
        direction: (p, n, 3) out; of a fixed direction, itself.
    """
    poses = stiffness.shape[0]
    for block in prange((poses + _BLOCK - 1) // _BLOCK):
        _block_peaks(
            block * _BLOCK, min(poses, (block + 1) * _BLOCK), periodic, start, duration, constant,
            slope, amplitude, wave, mass, jacobian, stiffness, joint_ratio, along, frequency, peak,
            direction,
        )  # fmt: skip
