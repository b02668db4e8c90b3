"""Compiled: one exact step of a linear system under a straight line of force; the grid of steps."""

# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

import numpy as np
from numba import njit

_TAYLOR = 14
_MOST_PARTS = 4000


@njit(cache=True, nogil=True)
def step_matrices(ik, ic, step):
    """exp(A h) (2N, 2N) and what accelerations at start and end of a step add, (2N, N) each."""
    n = ik.shape[0]
    size = 4 * n
    a = np.zeros((size, size))
    for i in range(n):
        a[i, n + i] = step
        a[n + i, 2 * n + i] = step
        a[2 * n + i, 3 * n + i] = 1.0
        for j in range(n):
            a[n + i, j] = -step * ik[i, j]
            a[n + i, n + j] = -step * ic[i, j]
    # Scaled as states are: the velocity's unit would make the norm large.
    norm = 0.0
    for i in range(n):
        norm = max(norm, np.sqrt(step * step * np.abs(ik[i]).sum()) + step * np.abs(ic[i]).sum())
    halvings = 0
    while norm > 0.5:
        norm *= 0.5
        halvings += 1
    a /= 2.0**halvings
    total = np.eye(size)
    term = np.eye(size)
    for k in range(1, 18):
        term = term @ a / k
        total += term
    for _ in range(halvings):
        total = total @ total
    exponential = total[: 2 * n, : 2 * n].copy()
    constant = total[: 2 * n, 2 * n : 3 * n].copy()
    slope = total[: 2 * n, 3 * n :].copy()
    return exponential, constant - slope, slope


@njit(cache=True, nogil=True)
def fastest_rate(ik, ic):
    """A bound of the system's rates, 1/s."""
    most = 0.0
    for i in range(ik.shape[0]):
        most = max(most, np.sqrt(np.abs(ik[i]).sum()) + np.abs(ic[i]).sum())
    return most


@njit(cache=True, nogil=True)
def taylor(y, f0, f1, length, ik, ic, fastest, out):
    """exp(A s) y plus accelerations that go from f0 to f1 in a straight line over `length`."""
    n = f0.size
    parts = min(max(int(np.ceil(length * fastest)), 1), _MOST_PARTS)
    short = length / parts
    slope = (f1 - f0) / parts
    term = np.empty(2 * n)
    new = np.empty(2 * n)
    for i in range(2 * n):
        out[i] = y[i]
    for part in range(parts):
        for i in range(2 * n):
            term[i] = out[i]  # the k-th derivative times length^k / k!
        for k in range(1, _TAYLOR):
            for i in range(n):
                new[i] = term[n + i]
                total = 0.0
                for j in range(n):
                    total -= ik[i, j] * term[j] + ic[i, j] * term[n + j]
                # The force is there in the first derivative; its slope comes in the second.
                if k == 1:
                    total += f0[i] + part * slope[i]
                elif k == 2:
                    total += slope[i]
                new[n + i] = total
            for i in range(2 * n):
                term[i] = new[i] * short / k
                out[i] += term[i]


@njit(cache=True, nogil=True)
def force_value(time, start, end, constant, slope, amplitude, omega):
    """A piecewise force (N) at a time; repeated where `end` is finite, else 0 before t = 0.

    The pieces are those of `picchio.excitation.PiecewiseForce`, (m,) each.
    """
    if np.isfinite(end):
        time = time % end
    if time < 0.0 or time >= end:
        return 0.0
    low, high = 0, start.size
    while high - low > 1:
        middle = (low + high) // 2
        if start[middle] <= time:
            low = middle
        else:
            high = middle
    u = time - start[low]
    value = constant[low] + slope[low] * u
    if amplitude[low] != 0.0:
        phase = omega[low] * u
        value += amplitude[low].real * np.cos(phase) - amplitude[low].imag * np.sin(phase)
    return value


@njit(cache=True, nogil=True)
def merged(origin, fine, count, extra, end, tolerance):
    """A grid of `count` points from `origin` on, `fine` apart, and the `extra` ones; ascending.

    Those beyond [0, end] are left out, and of those nearer than the tolerance (s) the later one;
    the first is 0.
    """
    points = np.empty(count + extra.size)
    size, i, j = 0, 0, 0
    last = -np.inf
    while i < count or j < extra.size:
        here = origin + fine * i if i < count else np.inf
        if j < extra.size and extra[j] < here:
            here = extra[j]
            j += 1
        else:
            i += 1
        if here < -tolerance or here > end + tolerance:
            continue
        if size == 0 or here - last > tolerance:
            points[size] = here
            size += 1
        last = here
    if size:
        points[0] = 0.0
    return points[:size]


@njit(cache=True, nogil=True)
def force_lines(points, gauss, start, end, constant, slope, amplitude, omega):
    """The straight line through the force at two Gauss points of every step, (K,) at either end."""
    force0, force1 = np.empty(points.size - 1), np.empty(points.size - 1)
    for k in range(points.size - 1):
        length = points[k + 1] - points[k]
        a = force_value(points[k] + gauss * length, start, end, constant, slope, amplitude, omega)
        b = force_value(
            points[k + 1] - gauss * length, start, end, constant, slope, amplitude, omega
        )
        mean, rise = 0.5 * (a + b), (b - a) / (1.0 - 2.0 * gauss)
        force0[k] = mean - 0.5 * rise
        force1[k] = mean + 0.5 * rise
    return force0, force1


@njit(cache=True, nogil=True)
def force_beside(points, offset, start, end, constant, slope, amplitude, omega):
    """The force `offset` s after each point, (K,)."""
    out = np.empty(points.size)
    for k in range(points.size):
        out[k] = force_value(points[k] + offset, start, end, constant, slope, amplitude, omega)
    return out


@njit(cache=True, nogil=True)
def sample_numbers(points, times, tolerance, first):
    """Which sample lies at each point, -1 where none does, (points,)."""
    place = 0
    out = np.full(points.size, -1)
    for i in range(times.size):
        while place < points.size and points[place] < times[i] - tolerance:
            place += 1
        if place == points.size:
            break
        out[place] = first + i
    return out
