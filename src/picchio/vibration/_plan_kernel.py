"""Compiled: steps between samples that end where a force jumps, and the force along them."""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import numpy as np
from numba import njit


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
def force_lines(points, gauss, start, end, constant, slope, amplitude, omega, force0, force1):
    """The straight line through the force at two Gauss points of every step, (K,) at either end."""
    for k in range(points.size - 1):
        length = points[k + 1] - points[k]
        a = force_value(points[k] + gauss * length, start, end, constant, slope, amplitude, omega)
        b = force_value(
            points[k + 1] - gauss * length, start, end, constant, slope, amplitude, omega
        )
        mean, rise = 0.5 * (a + b), (b - a) / (1.0 - 2.0 * gauss)
        force0[k] = mean - 0.5 * rise
        force1[k] = mean + 0.5 * rise


@njit(cache=True, nogil=True)
def force_beside(points, offset, start, end, constant, slope, amplitude, omega, out):
    """The force `offset` s after each point, into `out` (K,)."""
    for k in range(points.size):
        out[k] = force_value(points[k] + offset, start, end, constant, slope, amplitude, omega)


@njit(cache=True, nogil=True)
def sample_numbers(points, times, tolerance, first, out):
    """Which sample stands at each point, -1 where none does, into `out` (points,)."""
    place = 0
    for k in range(out.size):
        out[k] = -1
    for i in range(times.size):
        while place < points.size and points[place] < times[i] - tolerance:
            place += 1
        if place == points.size:
            break
        out[place] = first + i
