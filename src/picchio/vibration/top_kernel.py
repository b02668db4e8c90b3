"""Compiled search for the top of a joint's response: which samples it may be near, then exactly."""

from __future__ import annotations

import numpy as np
from numba import njit

from picchio.core.arrays import ComplexArray, FloatArray
from picchio.vibration.refine_kernel import piece_at, refine
from picchio.vibration.series_kernel import series_top

# Of the largest |g|^2: a sample below the first, or a parabola's top below the second, cannot
# belong to the top (see the samples a cycle).
_CANDIDATE = 0.9
_LIKELY = 0.96


@njit(cache=True, error_model="numpy", inline="always")
def _top(
    joint: int,
    k: int,
    count: int,
    periodic: bool,
    total: float,
    time: FloatArray,
    norm: FloatArray,
) -> tuple[float, float, float, float]:
    """Before a sampled maximum, at the parabola's top, after it, and how high that is."""
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
def highest(
    joint: int,
    count: int,
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
        a, t, b, top = _top(joint, k, count, periodic, total, time, norm)
        if top < _LIKELY * best:
            continue
        p = piece_at(time[k], start)
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
