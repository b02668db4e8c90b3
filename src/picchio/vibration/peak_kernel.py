"""Compiled peaks over time, and over all directions, for many poses."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from picchio.core.arrays import ComplexArray, FloatArray
from picchio.vibration.modal_kernel import modes_of
from picchio.vibration.oscillator_kernel import coefficients, exponential
from picchio.vibration.refine_kernel import refine
from picchio.vibration.sample_kernel import joint_norms, sample, steps_of
from picchio.vibration.series_kernel import TERMS, series_top

# Of the largest |g|^2: a sample below the first, or a parabola's top below the second, cannot
# belong to the top (see the samples a cycle).
_CANDIDATE = 0.9
_LIKELY = 0.96
_BLOCK = 128


@njit(cache=True, error_model="numpy", inline="always")
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
    dims: int,
    g: FloatArray,
    terms: FloatArray,
    space: FloatArray,
) -> FloatArray:
    """Peaks of one pose; returns the scratch space, which may have grown."""
    n = push.shape[0]
    for i in range(n):
        poles[i] = complex(-ratio[i] * omega[i], omega[i] * np.sqrt(1.0 - ratio[i] ** 2))
    coefficients(poles, duration, constant, slope, amplitude, wave, periodic, rows)
    endless = np.isinf(duration[-1])
    length = duration
    if endless:
        length = duration.copy()
        length[-1] = 2.0 * np.pi / omega[0]
    while True:
        count, total = 0, 0.0
        for p in range(length.shape[0]):
            count += steps_of(length[p], max(omega[n - 1], wave[p]))
            total += length[p]
        if count > space.shape[1]:
            space = np.empty((3 * n + 4, 2 * count))
        eta, norm, rate = space[:n, :count], space[n : 2 * n, :count], space[2 * n : 3 * n, :count]
        time, three = space[3 * n, :count], space[3 * n + 1 :, :count]
        sample(poles, rows, length, wave, omega[n - 1], eta, rate, time)
        done = True
        for j in range(n):
            peak[j] = joint_norms(j, eta, shapes, push, dims, three, norm)
            if endless and done:
                # Nothing after the samples can be larger than what is left of the modes.
                left = 0.0
                for d in range(dims):
                    most = 0.0
                    for i in range(n):
                        z = rows[i, -1, 0] * exponential(poles[i], length[-1])
                        most += abs(shapes[j, i] * push[i, d]) * abs(z) / poles[i].imag
                    left += most * most
                done = left <= peak[j]
        if done or length[-1] > 1e3 * np.pi / (ratio[0] * omega[0]):
            break
        length[-1] *= 2.0
    for j in range(n):
        direction[j, 0], direction[j, 1], direction[j, 2] = 0.0, 0.0, 1.0
        if peak[j] > 0.0:
            peak[j] = _highest(
                j, periodic, total, time, norm, eta, rate, start, poles, rows, constant, slope,
                amplitude, wave, shapes, push, g, terms, direction,
            )  # fmt: skip
    return space


@njit(cache=True, error_model="numpy", inline="always")
def _top(
    joint: int, k: int, periodic: bool, total: float, time: FloatArray, norm: FloatArray
) -> tuple[float, float, float, float]:
    """Before a sampled maximum, at the parabola's top, after it, and how high that is."""
    count = norm.shape[1]
    before = k - 1 if k > 0 else (count - 1 if periodic else 0)
    after = k + 1 if k + 1 < count else (0 if periodic else count - 1)
    a, t, b = time[before], time[k], time[after]
    if a > t:
        a -= total
    if b < t:
        b += total
    left, right, rise, fall = (
        t - a,
        b - t,
        norm[joint, k] - norm[joint, before],
        norm[joint, k] - norm[joint, after],
    )
    if left <= 0.0 or right <= 0.0:
        return a, t, b, norm[joint, k]
    bend = rise / left + fall / right
    if bend <= 0.0:
        return a, t, b, norm[joint, k]
    slope = (rise * right / left - fall * left / right) / (left + right)
    half = 0.5 * slope * (left + right) / bend
    half = min(max(half, -0.5 * left), 0.5 * right)
    return a, t + half, b, norm[joint, k] + 0.5 * max(slope * half, 0.0)


@njit(cache=True, error_model="numpy", inline="always")
def _highest(
    joint: int,
    periodic: bool,
    total: float,
    time: FloatArray,
    norm: FloatArray,
    eta: FloatArray,
    rate: FloatArray,
    start: FloatArray,
    poles: ComplexArray,
    rows: ComplexArray,
    constant: FloatArray,
    slope: FloatArray,
    amplitude: ComplexArray,
    wave: FloatArray,
    shapes: FloatArray,
    push: FloatArray,
    g: FloatArray,
    terms: FloatArray,
    direction: FloatArray,
) -> float:
    """The largest |g| of a joint; into `direction`, where it points."""
    count = norm.shape[1]
    likely = 0.0
    for k in range(count):
        if norm[joint, k] > likely:
            likely = norm[joint, k]
    best, floor = -1.0, _CANDIDATE * likely
    for k in range(count):
        here = norm[joint, k]
        if here < floor or here < norm[joint, k - 1 if k > 0 else (count - 1 if periodic else 0)]:
            continue
        if here < norm[joint, k + 1 if k + 1 < count else (0 if periodic else count - 1)]:
            continue
        a, t, b, top = _top(joint, k, periodic, total, time, norm)
        if top < _LIKELY * best:
            continue
        p = 0
        while p + 1 < start.shape[0] and start[p + 1] <= time[k]:
            p += 1
        value = -1.0
        if wave[p] == 0.0:
            u = time[k] - start[p]
            stop = start[p + 1] if p + 1 < start.shape[0] else total
            value = series_top(
                joint, k, t - time[k], -u, stop - time[k], constant[p] + slope[p] * u, slope[p],
                poles, eta, rate, shapes, push, terms, g,
            )  # fmt: skip
        if value < 0.0:  # the top is in another piece, or not near
            value = refine(
                joint, a, t, b, total if periodic else np.inf, start, poles, rows, constant, slope,
                amplitude, wave, shapes, push, g,
            )  # fmt: skip
        if value > best:
            best = value
            size = np.sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2])
            for d in range(3):
                direction[joint, d] = g[d] / size
    return np.sqrt(best)


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
        push = np.empty((n, 3))
        found = np.empty((n, 3))
        g = np.empty(3)
        terms = np.empty((TERMS, 3))
        space = np.empty((3 * n + 4, 256))
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
            space = _pose_peaks(
                periodic, start, duration, constant, slope, amplitude, wave, omega, ratio,
                shapes, push, poles, rows, peak[s], found, dims, g, terms, space,
            )  # fmt: skip
            for j in range(n):
                for d in range(3):
                    direction[s, j, d] = found[j, d] if dims == 3 else along[s, d]
