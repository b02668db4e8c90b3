"""Compiled peaks over time, and over all directions, for many poses."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from picchio.core.arrays import ComplexArray, FloatArray
from picchio.vibration.modal_kernel import modes_of
from picchio.vibration.oscillator_kernel import coefficients
from picchio.vibration.refine_kernel import refine
from picchio.vibration.sample_kernel import joint_norms, sample, steps_of

# Of the largest |g|^2: a sample below this cannot be beside the top.
_CANDIDATE = 0.95
_BLOCK = 64


@njit(cache=True, error_model="numpy")
def _pose_peaks(
    periodic: bool,
    start: FloatArray,
    duration: FloatArray,
    constant: FloatArray,
    slope: FloatArray,
    amplitude: ComplexArray,
    wave: FloatArray,
    omega: FloatArray,
    ratio: FloatArray,
    shapes: FloatArray,
    push: FloatArray,
    poles: ComplexArray,
    rows: ComplexArray,
    peak: FloatArray,
    direction: FloatArray,
) -> None:
    n, dims = push.shape
    for i in range(n):
        poles[i] = complex(-ratio[i] * omega[i], omega[i] * np.sqrt(1.0 - ratio[i] ** 2))
    coefficients(poles, duration, constant, slope, amplitude, wave, periodic, rows)
    endless = np.isinf(duration[-1])
    length = duration.copy()
    if endless:
        length[-1] = 2.0 * np.pi / omega[0]
    while True:
        count, total = 0, 0.0
        for p in range(length.shape[0]):
            count += steps_of(length[p], max(omega[n - 1], wave[p]))
            total += length[p]
        eta = np.empty((n, count))
        time = np.empty(count)
        norm = np.empty((n, count))
        sample(poles, rows, length, wave, omega[n - 1], eta, time)
        done = True
        for j in range(n):
            peak[j] = joint_norms(j, count, eta, shapes, push, norm[j])
            if endless and done:
                # Nothing after the samples can be larger than what is left of the modes.
                left = 0.0
                for d in range(dims):
                    most = 0.0
                    for i in range(n):
                        z = rows[i, -1, 0] * np.exp(poles[i] * length[-1])
                        most += abs(shapes[j, i] * push[i, d]) * abs(z) / poles[i].imag
                    left += most * most
                done = left <= peak[j]
        if done or length[-1] > 1e3 * np.pi / (ratio[0] * omega[0]):
            break
        length[-1] *= 2.0
    g, speed, change = np.empty(dims), np.empty(dims), np.empty(dims)
    for j in range(n):
        largest, best = peak[j], -1.0
        for d in range(dims):
            direction[j, d] = 1.0 if d == dims - 1 else 0.0
        peak[j] = 0.0
        if largest <= 0.0:
            continue
        for k in range(count):
            here = norm[j, k]
            if here < _CANDIDATE * largest:
                continue
            before = k - 1 if k > 0 else (count - 1 if periodic else 0)
            after = k + 1 if k + 1 < count else (0 if periodic else count - 1)
            if here < norm[j, before] or here < norm[j, after]:
                continue
            a, t, b = time[before], time[k], time[after]
            if a > t:
                a -= total
            if b < t:
                b += total
            # Begin at the top of the parabola through the three samples.
            h, rise, fall = b - t, here - norm[j, before], here - norm[j, after]
            if abs(h - (t - a)) < 1e-9 * h and rise + fall > 0.0:
                t += 0.5 * h * (rise - fall) / (rise + fall)
            value = refine(
                j, a, t, b, total if periodic else np.inf, start, poles, rows, constant, slope,
                amplitude, wave, shapes, push, g, speed, change,
            )  # fmt: skip
            if value > best:
                best = value
                size = 0.0
                for d in range(dims):
                    size += g[d] * g[d]
                for d in range(dims):
                    direction[j, d] = g[d] / np.sqrt(size)
        peak[j] = np.sqrt(best)


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
    poses, n = stiffness.shape
    dims = 3 if along.shape[0] == 0 else 1
    for block in prange((poses + _BLOCK - 1) // _BLOCK):
        work = np.empty((n, n))
        vectors = np.empty((n, n))
        omega = np.empty(n)
        ratio = np.empty(n)
        shapes = np.empty((n, n))
        push = np.empty((n, dims))
        found = np.empty((n, dims))
        poles = np.empty(n, dtype=np.complex128)
        rows = np.empty((n, duration.shape[0], 7), dtype=np.complex128)
        for s in range(block * _BLOCK, min(poses, (block + 1) * _BLOCK)):
            frequency[s, :] = np.nan
            peak[s, :] = np.nan
            direction[s, :, :] = np.nan
            if not modes_of(
                mass[s], stiffness[s], joint_ratio, work, vectors, omega, ratio, shapes
            ):
                continue
            under = True
            for i in range(n):
                frequency[s, i] = omega[i] / (2.0 * np.pi)
                under = under and 0.0 < ratio[i] < 1.0 - 1e-6
            if not under:
                continue
            push[:] = 0.0
            for i in range(n):
                for d in range(3):
                    moved = 0.0
                    for j in range(n):
                        moved += jacobian[s, d, j] * shapes[j, i]
                    if dims == 3:
                        push[i, d] = moved
                    else:
                        push[i, 0] += moved * along[s, d]
            _pose_peaks(
                periodic, start, duration, constant, slope, amplitude, wave, omega, ratio,
                shapes, push, poles, rows, peak[s], found,
            )  # fmt: skip
            for j in range(n):
                for d in range(3):
                    direction[s, j, d] = found[j, d] if dims == 3 else along[s, d]
