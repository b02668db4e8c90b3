"""Compiled search for the top of a joint's response: which samples it may be near, then exactly."""

from __future__ import annotations

import numpy as np
from numba import njit

from picchio.core.arrays import ComplexArray, FloatArray
from picchio.vibration.refine_kernel import piece_at, refine
from picchio.vibration.series_kernel import series_top

# Of the largest |g|^2 on the samples: no top beside a sample below this is the largest.
_CANDIDATE = 0.5
# How much higher than a cubic through values and slopes a top can be: of |g|, the modes'
# accelerations times their shares, and the step squared. A cubic misses a 48th of that times
# (omega h)^2, which is 0.4 of the fastest mode; modes that nearly cancel have larger accelerations
# than |g| itself.
_MISSED = 0.025


@njit(cache=True, error_model="numpy", inline="always")
def _moving(
    joint: int,
    k: int,
    force: float,
    poles: ComplexArray,
    eta: FloatArray,
    rate: FloatArray,
    shapes: FloatArray,
    push: FloatArray,
) -> tuple[float, float]:
    """Half the slope of |g|^2 at a sample, and a bound of how fast g's own slope changes."""
    x0, x1, x2, v0, v1, v2, bound = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(poles.shape[0]):
        fall, spin = poles[i].real, poles[i].imag
        x = eta[i, k]
        v = rate[i, k] + fall * x
        change = force + 2.0 * fall * v - (fall * fall + spin * spin) * x
        q0 = shapes[joint, i] * push[i, 0]
        q1 = shapes[joint, i] * push[i, 1]
        q2 = shapes[joint, i] * push[i, 2]
        x0, x1, x2 = x0 + q0 * x, x1 + q1 * x, x2 + q2 * x
        v0, v1, v2 = v0 + q0 * v, v1 + q1 * v, v2 + q2 * v
        bound += np.sqrt(q0 * q0 + q1 * q1 + q2 * q2) * abs(change)
    return x0 * v0 + x1 * v1 + x2 * v2, bound


@njit(cache=True, error_model="numpy", inline="always")
def _cubic_top(
    first: float, last: float, rise: float, fall: float, length: float
) -> tuple[float, float]:
    """Where in [0, length] the cubic of two values and slopes is highest, and how high."""
    # first + rise s + b s^2 + c s^3
    mean = (last - first) / length
    b = (3.0 * mean - 2.0 * rise - fall) / length
    c = (rise + fall - 2.0 * mean) / (length * length)
    at, top = 0.0, first
    if last > first:
        at, top = length, last
    under = b * b - 3.0 * rise * c
    if under >= 0.0:
        # The extremum where the second derivative is negative, without cancellation.
        root = np.sqrt(under)
        s = rise / (root - b) if b <= 0.0 else (-b - root) / (3.0 * c if c != 0.0 else np.inf)
        if 0.0 < s < length:
            value = first + s * (rise + s * (b + s * c))
            if value > top:
                at, top = s, value
    return at, top


@njit(cache=True, error_model="numpy", inline="always")
def _force(
    p: int,
    u: float,
    constant: FloatArray,
    slope: FloatArray,
    amplitude: ComplexArray,
    wave: FloatArray,
) -> float:
    """The force (N) of a piece, `u` s after it began."""
    force = constant[p] + slope[p] * u
    if wave[p] != 0.0:
        angle = wave[p] * u
        force += amplitude[p].real * np.cos(angle) - amplitude[p].imag * np.sin(angle)
    return float(force)


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
        before = k - 1 if k > 0 else (count - 1 if periodic else 0)
        after = k + 1 if k + 1 < count else (0 if periodic else count - 1)
        here = norm[joint, k]
        if here < floor or here < norm[joint, before] or here < norm[joint, after]:
            continue
        a, t, b = time[before], time[k], time[after]
        if a > t:
            a -= total
        if b < t:
            b += total
        p = piece_at(t, start)
        force = _force(p, t - start[p], constant, slope, amplitude, wave)
        climb, bound = _moving(joint, k, force, poles, eta, rate, shapes, push)
        beside, length = (after, b - t) if climb >= 0.0 else (before, t - a)
        guess, top = t, here
        if length > 0.0:
            # Where a piece ends the force may jump, but no slope does: any piece's will do.
            descent = _moving(joint, beside, 0.0, poles, eta, rate, shapes, push)[0]
            sign = 1.0 if climb >= 0.0 else -1.0
            move, top = _cubic_top(
                here, norm[joint, beside], 2.0 * sign * climb, 2.0 * sign * descent, length
            )
            guess = t + sign * move
        if top + _MISSED * np.sqrt(here) * bound * length * length < best:
            continue
        value = -1.0
        if wave[p] == 0.0:
            u = t - start[p]
            stop = start[p + 1] if p + 1 < start.shape[0] else total
            value = series_top(
                joint, k, guess - t, -u, stop - t, force, slope[p],
                poles, eta, rate, shapes, push, terms, g,
            )  # fmt: skip
        if value < 0.0:  # the top is in another piece, or not near
            value = refine(
                joint, a, guess, b, total if periodic else np.inf, start, poles, rows, constant,
                slope, amplitude, wave, shapes, push, g,
            )  # fmt: skip
        if value > best:
            best = value
            size = np.sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2])
            for d in range(3):
                direction[joint, d] = g[d] / size
    return np.sqrt(best)
