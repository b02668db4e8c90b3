"""Compiled peaks over time, and over all directions, for many poses."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from picchio.core.arrays import ComplexArray, FloatArray
from picchio.vibration.modal_kernel import modes_of
from picchio.vibration.oscillator_kernel import coefficients
from picchio.vibration.refine_kernel import refine
from picchio.vibration.sample_kernel import CUTS, cut, joint_norms, sample, steps_of

# Of the largest |g|^2 so far: a top below this cannot win, wherever it lies between its samples.
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
    pieces = duration.shape[0]
    for i in range(n):
        poles[i] = complex(-ratio[i] * omega[i], omega[i] * np.sqrt(1.0 - ratio[i] ** 2))
    coefficients(poles, duration, constant, slope, amplitude, wave, periodic, rows)
    endless = np.isinf(duration[-1])
    length = duration.copy()
    if endless:
        length[-1] = 2.0 * np.pi / omega[0]
    fine = np.empty((n, pieces), dtype=np.complex128)
    bend = np.empty((n, pieces))
    size = np.empty(n)
    for i in range(n):
        size[i] = 0.0
        for d in range(dims):
            size[i] += push[i, d] * push[i, d]
        size[i] = np.sqrt(size[i])
    while True:
        count, total = 0, 0.0
        for p in range(pieces):
            count += steps_of(length[p], max(omega[n - 1], wave[p]))
            total += length[p]
        free = np.empty((n, count), dtype=np.complex128)
        eta = np.empty((n, count))
        time = np.empty(count)
        owner = np.empty(count, dtype=np.int64)
        norm = np.empty((n, count))
        sample(poles, rows, length, wave, omega[n - 1], free, eta, time, owner, fine, bend)
        done = True
        for j in range(n):
            peak[j] = joint_norms(j, count, eta, shapes, push, norm[j])
            if endless and done:
                # Nothing after the samples can be larger than what is left of the modes.
                left = 0.0
                for i in range(n):
                    z = rows[i, -1, 0] * np.exp(poles[i] * length[-1])
                    left += abs(shapes[j, i]) * size[i] * abs(z) / poles[i].imag
                done = left * left <= peak[j]
        if done or length[-1] > 1e3 * np.pi / (ratio[0] * omega[0]):
            break
        length[-1] *= 2.0
    g, speed, change = np.empty(dims), np.empty(dims), np.empty(dims)
    cuts = np.empty(CUTS + 1)
    room = np.empty(pieces)
    tops = np.empty(count * (CUTS + 1))
    times = np.empty(count * (CUTS + 1))
    reach = np.empty(count * (CUTS + 1))
    for j in range(n):
        largest = peak[j]
        for d in range(dims):
            direction[j, d] = 1.0 if d == dims - 1 else 0.0
        peak[j] = 0.0
        if largest <= 0.0:
            continue
        for p in range(pieces):
            room[p] = 0.0
            for i in range(n):
                room[p] += abs(shapes[j, i]) * size[i] * bend[i, p]
        found = 0
        for k in range(count):
            p = owner[k]
            after = norm[j, k + 1] if k + 1 < count else norm[j, 0 if periodic else k]
            bound = np.sqrt(max(norm[j, k], after)) + room[p]
            if bound * bound < largest:
                continue
            end = time[k + 1] if k + 1 < count else total
            h = (end - time[k]) / CUTS
            cuts[0] = norm[j, k]
            cut(j, k, p, time[k] - start[p], h, poles, rows, wave, free, fine, shapes, push, cuts)
            for c in range(CUTS + 1):
                largest = max(largest, cuts[c])
                # A cut's end is the next interval's start; both may claim it.
                if (c == 0 or cuts[c] >= cuts[c - 1]) and (c == CUTS or cuts[c] >= cuts[c + 1]):
                    tops[found], times[found], reach[found] = cuts[c], time[k] + c * h, h
                    if 0 < c < CUTS:
                        # Begin at the top of the parabola through three samples.
                        rise, fall = cuts[c] - cuts[c - 1], cuts[c] - cuts[c + 1]
                        if rise + fall > 0.0:
                            times[found] += 0.5 * h * (rise - fall) / (rise + fall)
                    found += 1
        best = -1.0
        for m in range(found):
            if tops[m] < _CANDIDATE * largest:
                continue
            low, high = times[m] - 1.5 * reach[m], times[m] + 1.5 * reach[m]
            if not periodic:
                low, high = max(low, 0.0), min(high, total)
            value = refine(
                j, low, times[m], high, total if periodic else np.inf, start, poles, rows,
                constant, slope, amplitude, wave, shapes, push, g, speed, change,
            )  # fmt: skip
            if value > best:
                best = value
                length_g = 0.0
                for d in range(dims):
                    length_g += g[d] * g[d]
                for d in range(dims):
                    direction[j, d] = g[d] / np.sqrt(length_g)
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
