"""Compiled search for the top of a joint's response |g|.

The response is sampled (`sample`, `joint_norms`); `highest` picks the samples that the top may be
near, and finds it there exactly: by a series in time about the sample (`series_top`), or by Newton
steps between two samples (`refine`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from picchio.core.arrays import ComplexArray, FloatArray
from picchio.vibration.batch.modal_kernel import exponential

# Samples a cycle of the fastest mode. |g|^2 swings twice as fast: a top between two samples is
# at most 10 % above both, unless modes nearly cancel (see `_MISSED`).
_PER_CYCLE = 10.0
_FAST = {"contract", "reassoc", "nsz", "arcp"}
# Of the largest |g|^2 on the samples: no top beside a sample below this is the largest.
_CANDIDATE = 0.5
# How much higher than a cubic through values and slopes a top can be: of |g|, the modes'
# accelerations times their shares, and the step squared. A cubic misses a 48th of that times
# (omega h)^2, which is 0.4 of the fastest mode; modes that nearly cancel have larger accelerations
# than |g| itself.
_MISSED = 0.025
# Derivatives of g in the series, and how far from the sample, in rad of the fastest mode, it
# serves: 0.35^12 / 12! = 7e-15 of that mode's share is left out.
TERMS = 12
_NEAR = 0.35
_SERIES_STEPS = 6
_REFINE_STEPS = 40
# Of the bracket: the last step's own error is its square, and a maximum is off by the square of
# that, once what the step itself gains is added.
_PRECISION = 2e-5


class Samples(NamedTuple):
    """Room for samples of one pose, used again for the next; only the first columns are in use.

    Each array is whole: a slice has a stride that the compiler does not know, and its loops then
    take one sample at a time instead of four.

    Attributes:
        time: (k,) s.
        eta: (n, k) deflections of the modes.
        rate: (n, k) real parts of their states.
        norm: (n, k) |g|^2 of every joint.
        g: (3, k) of one joint.
    """

    time: FloatArray
    eta: FloatArray
    rate: FloatArray
    norm: FloatArray
    g: FloatArray


@njit(cache=True)
def room_for(n: int, count: int) -> Samples:
    """Room for `count` samples of n modes and joints."""
    return Samples(
        np.empty(count), np.empty((n, count)), np.empty((n, count)), np.empty((n, count)),
        np.empty((3, count)),
    )  # fmt: skip


@njit(cache=True, error_model="numpy")
def steps_of(duration: float, rate: float) -> int:
    """How many samples a piece of `duration` s takes at `rate` rad/s."""
    return max(1, int(np.ceil(duration * rate * (_PER_CYCLE / (2.0 * np.pi)))))


@njit(cache=True, error_model="numpy", inline="always")
def _add_decay(
    state: complex,
    factor: complex,
    scale: float,
    i: int,
    first: int,
    last: int,
    eta: FloatArray,
    rate: FloatArray,
) -> None:
    """Add Im(state factor^k) scale and Re(state factor^k) to samples first to last - 1 of row i.

    In two chains, so that none waits for itself.
    """
    second = factor * factor
    c, d = second.real, second.imag
    odd = state * factor
    a0, b0, a1, b1 = state.real, state.imag, odd.real, odd.imag
    k = first
    while k + 2 <= last:
        rate[i, k] += a0
        eta[i, k] += b0 * scale
        rate[i, k + 1] += a1
        eta[i, k + 1] += b1 * scale
        a0, b0 = a0 * c - b0 * d, a0 * d + b0 * c
        a1, b1 = a1 * c - b1 * d, a1 * d + b1 * c
        k += 2
    if k < last:
        rate[i, k] += a0
        eta[i, k] += b0 * scale


@njit(cache=True, error_model="numpy", inline="always")
def sample(
    poles: ComplexArray,
    rows: ComplexArray,
    duration: FloatArray,
    wave: FloatArray,
    fastest: float,
    eta: FloatArray,
    rate: FloatArray,
    time: FloatArray,
) -> None:
    """Oscillators' deflections (n, k) at times (k,) over all pieces, by recurrence.

    `rate` (n, k) has the real parts of their states: rates less Re(pole) times deflections.
    """
    count, began = 0, 0.0
    for p in range(duration.shape[0]):
        steps = steps_of(duration[p], max(fastest, wave[p]))
        h = duration[p] / steps
        for i in range(poles.shape[0]):
            scale = 1.0 / poles[i].imag
            level, rise = rows[i, p, 1], rows[i, p, 2] * h
            for k in range(steps):
                eta[i, count + k] = (level.imag + rise.imag * k) * scale
                rate[i, count + k] = level.real + rise.real * k
            last = count + steps
            _add_decay(rows[i, p, 0], exponential(poles[i], h), scale, i, count, last, eta, rate)
            if wave[p] != 0.0:
                spin = exponential(complex(0.0, wave[p]), h)
                _add_decay(rows[i, p, 3], spin, scale, i, count, last, eta, rate)
                _add_decay(rows[i, p, 4], spin.conjugate(), scale, i, count, last, eta, rate)
        for k in range(steps):
            time[count + k] = began + h * k
        began += duration[p]
        count += steps


@njit(cache=True, error_model="numpy", fastmath=_FAST)
def joint_norms(
    joint: int,
    count: int,
    eta: FloatArray,
    pull: FloatArray,
    dims: int,
    g: FloatArray,
    norm: FloatArray,
) -> float:
    """|g|^2 of a joint on the samples, into its row (joint, k), and its largest; g is scratch.

    `dims` is 1 where only the first column of `pull` (n, 3) is not zero.
    """
    n = pull.shape[0]
    for d in range(dims):
        weight = pull[0, d]
        for k in range(count):
            g[d, k] = weight * eta[0, k]
        i = 1
        while i + 1 < n:  # two modes at a time: half as many ways to memory and back
            first, second = pull[i, d], pull[i + 1, d]
            for k in range(count):
                g[d, k] += first * eta[i, k] + second * eta[i + 1, k]
            i += 2
        if i < n:
            weight = pull[i, d]
            for k in range(count):
                g[d, k] += weight * eta[i, k]
    largest = 0.0
    for k in range(count):
        size = g[0, k] * g[0, k]
        if dims == 3:
            size += g[1, k] * g[1, k] + g[2, k] * g[2, k]
        norm[joint, k] = size
    for k in range(count):
        largest = max(largest, norm[joint, k])
    return largest


@njit(cache=True, error_model="numpy", inline="always")
def piece_at(time: float, start: FloatArray) -> int:
    """The last piece of the force that has begun at a time, s."""
    p = 0
    while p + 1 < start.shape[0] and start[p + 1] <= time:
        p += 1
    return p


@njit(cache=True, error_model="numpy")
def refine(
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
    pull: FloatArray,
    g: FloatArray,
) -> float:
    """|g|^2 at the maximum in (a, b), and g (3,) there; Newton on its slope, in the bracket.

    Everything is in scalars: views into arrays cost more than the arithmetic.
    """
    n = poles.shape[0]
    width = b - a
    norm = 0.0
    for _ in range(_REFINE_STEPS):
        inside = t
        if inside < 0.0:
            inside += total
        elif inside >= total:
            inside -= total
        p = piece_at(inside, start)
        u = inside - start[p]
        force = constant[p] + slope[p] * u
        turn, sway = 0.0, 0.0
        if wave[p] != 0.0:
            turn, sway = math.cos(wave[p] * u), math.sin(wave[p] * u)
            force += amplitude[p].real * turn - amplitude[p].imag * sway
        x0, x1, x2 = 0.0, 0.0, 0.0
        v0, v1, v2 = 0.0, 0.0, 0.0
        a0, a1, a2 = 0.0, 0.0, 0.0
        for i in range(n):
            fall, spin = poles[i].real, poles[i].imag
            size, angle = math.exp(fall * u), spin * u
            cosine, sine = size * math.cos(angle), size * math.sin(angle)
            free = rows[i, p, 0]
            real = free.real * cosine - free.imag * sine + rows[i, p, 1].real
            imag = free.real * sine + free.imag * cosine + rows[i, p, 1].imag
            real += rows[i, p, 2].real * u
            imag += rows[i, p, 2].imag * u
            if wave[p] != 0.0:
                plus, minus = rows[i, p, 3], rows[i, p, 4]
                real += (plus.real + minus.real) * turn - (plus.imag - minus.imag) * sway
                imag += (plus.imag + minus.imag) * turn + (plus.real - minus.real) * sway
            x = imag / spin
            v = real + fall * x
            change = force + 2.0 * fall * v - (fall * fall + spin * spin) * x
            q0, q1, q2 = pull[i, 0], pull[i, 1], pull[i, 2]
            x0, x1, x2 = x0 + q0 * x, x1 + q1 * x, x2 + q2 * x
            v0, v1, v2 = v0 + q0 * v, v1 + q1 * v, v2 + q2 * v
            a0, a1, a2 = a0 + q0 * change, a1 + q1 * change, a2 + q2 * change
        norm = x0 * x0 + x1 * x1 + x2 * x2
        first = x0 * v0 + x1 * v1 + x2 * v2
        second = v0 * v0 + v1 * v1 + v2 * v2 + x0 * a0 + x1 * a1 + x2 * a2
        if first > 0.0:
            a = t
        else:
            b = t
        new = t - first / second if second < 0.0 else 0.5 * (a + b)
        newton = second < 0.0 and a <= new <= b
        if not newton:
            new = 0.5 * (a + b)
        step = new - t
        t = new
        g[0], g[1], g[2] = x0, x1, x2
        if abs(step) <= _PRECISION * width:
            if newton:  # what the last, unevaluated step would still have gained
                norm -= first * first / second
                half = 0.5 * step
                g[0] += step * (v0 + half * a0)
                g[1] += step * (v1 + half * a1)
                g[2] += step * (v2 + half * a2)
            break
    return norm


@njit(cache=True, error_model="numpy", inline="always")
def series_top(
    k: int,
    hint: float,
    low: float,
    high: float,
    force: float,
    tilt: float,
    poles: ComplexArray,
    eta: FloatArray,
    rate: FloatArray,
    pull: FloatArray,
    terms: FloatArray,
    g: FloatArray,
) -> float:
    """|g|^2 at its top near a sample, and g (3,) there; negative where the top is not near.

    The sample has every mode's state already, so that no exponential is taken.

    Args:
        k: the sample.
        hint: s, from the sample to where the top is thought to be.
        low: s, how far back the sample's piece of the force goes.
        high: s, how far ahead.
        force: N, at the sample.
        tilt: N/s, its slope.
        poles: (n,) ascending, 1/s.
        eta: (n, samples) deflections of the modes.
        rate: (n, samples) real parts of their states.
        pull: (n, 3) of the joint: its deflection by each mode's, for each axis of the force.
        terms: (TERMS, 3) scratch: derivatives of g, then its series.
        g: (3,) out.
    """
    n = poles.shape[0]
    most = _NEAR / poles[n - 1].imag
    for m in range(TERMS):
        terms[m, 0], terms[m, 1], terms[m, 2] = 0.0, 0.0, 0.0
    for i in range(n):
        fall, spin = poles[i].real, poles[i].imag
        twice, square = 2.0 * fall, fall * fall + spin * spin
        q0, q1, q2 = pull[i, 0], pull[i, 1], pull[i, 2]
        before = eta[i, k]
        here = rate[i, k] + fall * before
        drive, next_drive = force, tilt
        for m in range(TERMS):
            terms[m, 0] += q0 * before
            terms[m, 1] += q1 * before
            terms[m, 2] += q2 * before
            before, here = here, drive + twice * here - square * before
            drive, next_drive = next_drive, 0.0
    factor = 1.0
    for m in range(2, TERMS):
        factor /= m
        for d in range(3):
            terms[m, d] *= factor
    s = min(max(hint, low), high)
    for _ in range(_SERIES_STEPS):
        # The axes side by side: each chain of products waits for itself alone.
        y0, y1, y2 = terms[TERMS - 1, 0], terms[TERMS - 1, 1], terms[TERMS - 1, 2]
        w0, w1, w2, z0, z1, z2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for m in range(TERMS - 2, -1, -1):
            z0, z1, z2 = z0 * s + w0, z1 * s + w1, z2 * s + w2
            w0, w1, w2 = w0 * s + y0, w1 * s + y1, w2 * s + y2
            y0, y1, y2 = y0 * s + terms[m, 0], y1 * s + terms[m, 1], y2 * s + terms[m, 2]
        norm = y0 * y0 + y1 * y1 + y2 * y2
        first = y0 * w0 + y1 * w1 + y2 * w2
        second = w0 * w0 + w1 * w1 + w2 * w2 + 2.0 * (y0 * z0 + y1 * z1 + y2 * z2)
        if not second < 0.0:
            return -1.0
        step = -first / second
        if not (low <= s + step <= high and abs(s + step) <= most):
            return -1.0
        if abs(step) <= 1e-4 * most:  # 3e-5 rad: what is left is its cube
            g[0] = y0 + step * (w0 + step * z0)
            g[1] = y1 + step * (w1 + step * z1)
            g[2] = y2 + step * (w2 + step * z2)
            return norm - first * first / second
        s += step
    return -1.0


@njit(cache=True, error_model="numpy", inline="always")
def _moving(
    k: int,
    force: float,
    poles: ComplexArray,
    eta: FloatArray,
    rate: FloatArray,
    pull: FloatArray,
) -> tuple[float, float]:
    """Half the slope of |g|^2 at a sample, and a bound of how fast g's own slope changes."""
    x0, x1, x2, v0, v1, v2, bound = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(poles.shape[0]):
        fall, spin = poles[i].real, poles[i].imag
        x = eta[i, k]
        v = rate[i, k] + fall * x
        change = force + 2.0 * fall * v - (fall * fall + spin * spin) * x
        q0, q1, q2 = pull[i, 0], pull[i, 1], pull[i, 2]
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
    largest: float,
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
    pull: FloatArray,
    g: FloatArray,
    terms: FloatArray,
    direction: FloatArray,
) -> float:
    """The largest |g| of a joint, from that of |g|^2 on the samples; its way into `direction`."""
    best, floor = -1.0, _CANDIDATE * largest
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
        climb, bound = _moving(k, force, poles, eta, rate, pull)
        beside, length = (after, b - t) if climb >= 0.0 else (before, t - a)
        guess, top = t, here
        if length > 0.0:
            # Where a piece ends the force may jump, but no slope does: any piece's will do.
            descent = _moving(beside, 0.0, poles, eta, rate, pull)[0]
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
                k, guess - t, -u, stop - t, force, slope[p], poles, eta, rate, pull, terms, g
            )
        if value < 0.0:  # the top is in another piece, or not near
            value = refine(
                a, guess, b, total if periodic else np.inf, start, poles, rows, constant,
                slope, amplitude, wave, pull, g,
            )  # fmt: skip
        if value > best:
            best = value
            size = np.sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2])
            for d in range(3):
                direction[joint, d] = g[d] / size
    return np.sqrt(best)
