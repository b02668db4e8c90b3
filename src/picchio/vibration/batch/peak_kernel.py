"""Compiled peaks over time, and over all directions, for many poses."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from picchio.core.arrays import ComplexArray, FloatArray
from picchio.vibration.batch.modal_kernel import coefficients, exponential, modes_of
from picchio.vibration.batch.top_kernel import (
    TERMS,
    highest,
    joint_norms,
    room_for,
    sample,
    steps_of,
)

_BLOCK = 128


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
    work = np.empty((n, n))
    vectors = np.empty((n, n))
    omega = np.empty(n)
    ratio = np.empty(n)
    shapes = np.empty((n, n))
    pull = np.empty((n, n, 3))  # of a joint, by a mode, for an axis of the force
    found = np.empty((n, 3))
    g = np.empty(3)
    terms = np.empty((TERMS, 3))
    room = room_for(n, 256)
    poles = np.empty(n, dtype=np.complex128)
    rows = np.empty((n, duration.shape[0], 7), dtype=np.complex128)
    endless, length = np.isinf(duration[-1]), duration.copy()
    for s in range(first, last):
        frequency[s, :] = np.nan
        peak[s, :] = np.nan
        direction[s, :, :] = np.nan
        if not modes_of(
            mass[s], stiffness[s], joint_ratio, work, vectors, omega, ratio, shapes, frequency[s],
            poles,
        ):  # fmt: skip
            continue
        pull[:] = 0.0
        for i in range(n):
            push = 0.0
            for d in range(3):
                moved = 0.0
                for j in range(n):
                    moved += jacobian[s, d, j] * shapes[j, i]
                push = moved if dims == 3 else push + moved * along[s, d]
                for j in range(n):
                    pull[j, i, d if dims == 3 else 0] = shapes[j, i] * push
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
            sample(poles, rows, length, wave, omega[n - 1], room.eta, room.rate, room.time)
            done = True
            for j in range(n):
                peak[s, j] = joint_norms(j, count, room.eta, pull[j], dims, room.g, room.norm)
                if endless and done:
                    # Nothing after the samples can be larger than what is left of the modes.
                    left = 0.0
                    for d in range(dims):
                        most = 0.0
                        for i in range(n):
                            z = rows[i, -1, 0] * exponential(poles[i], length[-1])
                            most += abs(pull[j, i, d]) * abs(z) / poles[i].imag
                        left += most * most
                    done = left <= peak[s, j]
            if done or length[-1] > 1e3 * np.pi / (ratio[0] * omega[0]):
                break
            length[-1] *= 2.0
        for j in range(n):
            found[j, 0], found[j, 1], found[j, 2] = 0.0, 0.0, 1.0
            if peak[s, j] > 0.0:
                peak[s, j] = highest(
                    j, count, periodic, total, peak[s, j], room.time, room.norm, room.eta,
                    room.rate, start, poles, rows, constant, slope, amplitude, wave, pull[j], g,
                    terms, found,
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
