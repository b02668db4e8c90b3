"""Compiled peaks over time, and over all directions, for many poses."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from picchio.core.arrays import ComplexArray, FloatArray
from picchio.vibration.modal_kernel import modes_of
from picchio.vibration.oscillator_kernel import coefficients, evaluate

# Samples a cycle of the fastest mode: a peak between two samples is at most 2 % above both.
_PER_CYCLE = 16.0
_CANDIDATE = 0.95
_NEWTON = 40
# Of the bracket: a maximum is off by the square of this.
_PRECISION = 1e-5
_BLOCK = 64


@njit(cache=True, error_model="numpy")
def _steps(duration: float, rate: float) -> int:
    return max(1, int(np.ceil(duration * rate * (_PER_CYCLE / (2.0 * np.pi)))))


@njit(cache=True, error_model="numpy")
def _sample(
    poles: ComplexArray,
    rows: ComplexArray,
    duration: FloatArray,
    wave: FloatArray,
    fastest: float,
    eta: FloatArray,
    time: FloatArray,
) -> None:
    """Oscillators' deflections (n, k) at times (k,) over all pieces, by recurrence."""
    count, began = 0, 0.0
    for p in range(duration.shape[0]):
        steps = _steps(duration[p], max(fastest, wave[p]))
        h = duration[p] / steps
        spin = np.exp(1j * wave[p] * h) if wave[p] != 0.0 else 1.0 + 0.0j
        for i in range(poles.shape[0]):
            free, level, rise = rows[i, p, 0], rows[i, p, 1], rows[i, p, 2] * h
            plus, minus = rows[i, p, 3], rows[i, p, 4]
            decay = np.exp(poles[i] * h)
            scale = 1.0 / poles[i].imag
            for k in range(steps):
                eta[i, count + k] = (free + level + rise * k + plus + minus).imag * scale
                free *= decay
                if wave[p] != 0.0:
                    plus *= spin
                    minus *= spin.conjugate()
        for k in range(steps):
            time[count + k] = began + h * k
        began += duration[p]
        count += steps


@njit(cache=True, error_model="numpy")
def _refine(
    joint: int,
    a: float,
    t: float,
    b: float,
    total: float,
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
    speed: FloatArray,
    change: FloatArray,
) -> float:
    """|g|^2 at the maximum in (a, b), and g there; Newton on its slope, kept in the bracket."""
    n, dims = push.shape
    width = b - a
    norm = 0.0
    for _ in range(_NEWTON):
        inside = t % total
        p = 0
        while p + 1 < start.shape[0] and start[p + 1] <= inside:
            p += 1
        u = inside - start[p]
        force = constant[p] + slope[p] * u
        if wave[p] != 0.0:
            force += (amplitude[p] * np.exp(1j * wave[p] * u)).real
        norm, first, second = 0.0, 0.0, 0.0
        for d in range(dims):
            g[d], speed[d], change[d] = 0.0, 0.0, 0.0
        for i in range(n):
            pole = poles[i]
            z = evaluate(pole, rows[i, p], wave[p], u)
            rate = pole * z
            x = z.imag / pole.imag * shapes[joint, i]
            v = rate.imag / pole.imag * shapes[joint, i]
            acceleration = ((pole * rate).imag / pole.imag + force) * shapes[joint, i]
            for d in range(dims):
                g[d] += x * push[i, d]
                speed[d] += v * push[i, d]
                change[d] += acceleration * push[i, d]
        for d in range(dims):
            norm += g[d] * g[d]
            first += g[d] * speed[d]
            second += speed[d] * speed[d] + g[d] * change[d]
        if first > 0.0:
            a = t
        else:
            b = t
        new = t - first / second if second < 0.0 else 0.5 * (a + b)
        if not a <= new <= b:
            new = 0.5 * (a + b)
        step = abs(new - t)
        t = new
        if step <= _PRECISION * width:
            # What the last, unevaluated step would still have gained.
            if second < 0.0:
                norm -= first * first / second
            break
    return norm


@njit(cache=True, error_model="numpy")
def _joint_norms(
    joint: int, count: int, eta: FloatArray, shapes: FloatArray, push: FloatArray, norm: FloatArray
) -> float:
    """|g|^2 of a joint on the samples (k,), and its largest."""
    n, dims = push.shape
    norm[:count] = 0.0
    value = np.empty(count)
    for d in range(dims):
        value[:] = 0.0
        for i in range(n):
            weight = shapes[joint, i] * push[i, d]
            for k in range(count):
                value[k] += weight * eta[i, k]
        for k in range(count):
            norm[k] += value[k] * value[k]
    largest = 0.0
    for k in range(count):
        largest = max(largest, norm[k])
    return largest


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
            count += _steps(length[p], max(omega[n - 1], wave[p]))
            total += length[p]
        eta = np.empty((n, count))
        time = np.empty(count)
        norm = np.empty((n, count))
        _sample(poles, rows, length, wave, omega[n - 1], eta, time)
        done = True
        for j in range(n):
            peak[j] = _joint_norms(j, count, eta, shapes, push, norm[j])
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
            value = _refine(
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
