"""Compiled turning points of a rivet: the response from rest, ring-down included, turn by turn."""

from __future__ import annotations

import numpy as np
from numba import njit

from picchio.core.arrays import ComplexArray, FloatArray, IndexArray
from picchio.vibration.batch.modal_kernel import coefficients
from picchio.vibration.closed_form.response import RING_DOWN_LEVEL

# Samples a cycle of the fastest mode that lives: a turn's value is then off by 1e-7 of it.
FINE = 16.0
# By half of them: off by 5e-6 of it, in half the time. For worlds drawn from estimates.
COARSE = 8.0
# A mode asks for its own step until its free decay has fallen as far: exp(-16) = 1e-7.
_DECAYED = 16.0 / np.log(FINE)
# Samples of one response, 80 MB a joint: a mode almost without damping takes more.
_MOST = 10_000_000
# Samples between two looks whether anything larger can still come.
_LOOK = 64


@njit(cache=True, error_model="numpy")
def steps_until(  # type: ignore[no-untyped-def]
    poles: ComplexArray, wave: float, reached: float, length: float, per_cycle: float
):
    """The next stretch of a piece: how long it is, s, and how many samples it takes.

    The fastest mode that lives at `reached` s sets the step until it has died.
    """
    decayed = _DECAYED * np.log(per_cycle)
    rate, life = wave, length if wave > 0.0 else reached
    slowest = np.inf
    for i in range(poles.shape[0]):
        own = min(decayed / -poles[i].real, length)
        speed = abs(poles[i])
        slowest = min(slowest, speed)
        if own > reached and speed > rate:
            rate, life = speed, own
    if life <= reached:  # all have died: the slowest leads to the end
        rate, life = slowest, length
    span = life - reached
    return span, max(1, int(np.ceil(span * rate * (per_cycle / (2.0 * np.pi)))))


@njit(cache=True, error_model="numpy")
def most_samples(
    poles: ComplexArray, wave: FloatArray, length: FloatArray, per_cycle: float
) -> int:
    """How many samples all pieces take; no joint turns more often."""
    count = 2
    for p in range(length.shape[0]):
        reached = 0.0
        while reached < length[p]:
            span, steps = steps_until(poles, wave[p], reached, length[p], per_cycle)
            count += steps
            reached = reached + span if span > 0.0 else length[p]
    return count


@njit(cache=True, error_model="numpy")
def between(h: float, x0: float, v0: float, a0: float, x1: float, v1: float, a1: float) -> float:
    """The extremum between two samples whose speeds differ in sign: quintic through both."""
    c1, c2 = v0 * h, 0.5 * a0 * h * h
    e1, e2, e3 = x1 - x0 - c1 - c2, v1 * h - c1 - 2.0 * c2, a1 * h * h - 2.0 * c2
    c3 = 10.0 * e1 - 4.0 * e2 + 0.5 * e3
    c4 = -15.0 * e1 + 7.0 * e2 - e3
    c5 = 6.0 * e1 - 3.0 * e2 + 0.5 * e3
    low, high = 0.0, 1.0
    s = v0 / (v0 - v1)
    for _ in range(6):
        slope = c1 + s * (2.0 * c2 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))
        bend = 2.0 * c2 + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5))
        if (slope > 0.0) == (v0 > 0.0):
            low = s
        else:
            high = s
        new = s - slope / bend if bend != 0.0 else 0.5 * (low + high)
        if not low <= new <= high:
            new = 0.5 * (low + high)
        if abs(new - s) < 1e-4:  # Newton: the next one would be off by its square
            s = new
            break
        s = new
    return x0 + s * (c1 + s * (c2 + s * (c3 + s * (c4 + s * c5))))


@njit(cache=True, error_model="numpy")
def turns_from_rest(
    poles: ComplexArray,
    weights: FloatArray,
    enough: FloatArray,
    duration: FloatArray,
    constant: FloatArray,
    slope: FloatArray,
    amplitude: ComplexArray,
    wave: FloatArray,
    per_cycle: float,
) -> tuple[FloatArray, IndexArray]:
    """Every joint's deflection at rest, at its turns and at the end of the ring-down.

    Args:
        poles: (m,) of the modes, 1/s.
        weights: (n, m) deflection of each joint per mode.
        enough: (n,) rad; a joint whose range stays below needs its extremes only, and where all
            do, the ring-down ends when nothing larger can come. Negative: all of it, always.
        duration: (pieces,) s, of a burst, the last endless; see `PiecewiseForce` for these.
        constant: (pieces,) N.
        slope: (pieces,) N/s.
        amplitude: (pieces,) complex N.
        wave: (pieces,) rad/s.
        per_cycle: samples a cycle of the fastest mode that lives: `FINE` or `COARSE`.

    Returns:
        (n, k) rad, and how many of the k each joint has, (n,): none where the ring-down is too
        long to be held in memory.
    """
    n, m = weights.shape
    pieces = duration.shape[0]
    rows = np.empty((m, pieces, 7), dtype=np.complex128)
    coefficients(poles, duration, constant, slope, amplitude, wave, False, rows)
    length = duration.copy()
    length[-1] = -np.log(RING_DOWN_LEVEL) / (-poles.real).min()
    most = most_samples(poles, wave, length, per_cycle)
    if most > _MOST:
        return np.empty((n, 0)), np.zeros(n, dtype=np.int64)
    turns = np.empty((n, most))
    count = np.ones(n, dtype=np.int64)
    turns[:, 0] = 0.0
    # Of each mode, for a block of samples and the one before it: where it is and how fast. Block
    # by block and in real numbers, so that the inner loops run on vector units.
    x, v, fast = np.zeros((m, _LOOK + 1)), np.zeros((m, _LOOK + 1)), np.zeros((n, _LOOK + 1))
    turned_r, turned_i = np.empty((m, _LOOK + 1)), np.empty((m, _LOOK + 1))
    spun = np.ones(_LOOK, dtype=np.complex128)
    zr, zi = np.empty(m), np.empty(m)
    real, inverse = poles.real.copy(), 1.0 / poles.imag
    top, bottom = np.zeros(n), np.zeros(n)
    for p in range(pieces):
        forced = wave[p] != 0.0
        for i in range(m):
            forced = forced or rows[i, p, 1] != 0.0 or rows[i, p, 2] != 0.0
        reached = 0.0
        while reached < length[p]:
            span, steps = steps_until(poles, wave[p], reached, length[p], per_cycle)
            if span <= 0.0:
                break
            h = span / steps
            for i in range(m):
                free = rows[i, p, 0] * np.exp(poles[i] * reached)
                zr[i], zi[i] = free.real, free.imag
                step, power = np.exp(poles[i] * h), 1.0 + 0.0j
                for k in range(min(_LOOK, steps + 1) + 1):
                    turned_r[i, k], turned_i[i, k] = power.real, power.imag
                    power *= step
            ended = False
            for start in range(0, steps + 1, _LOOK):
                size = min(_LOOK, steps + 1 - start)
                if forced:
                    spin, spun[0] = (
                        np.exp(1j * wave[p] * h),
                        np.exp(1j * wave[p] * (reached + start * h)),
                    )
                    for k in range(1, size):
                        spun[k] = spun[k - 1] * spin
                for i in range(m):
                    own_r, own_i = zr[i], zi[i]
                    for k in range(size):
                        x[i, k + 1] = own_r * turned_i[i, k] + own_i * turned_r[i, k]
                        v[i, k + 1] = own_r * turned_r[i, k] - own_i * turned_i[i, k]
                    zr[i] = own_r * turned_r[i, size] - own_i * turned_i[i, size]
                    zi[i] = own_r * turned_i[i, size] + own_i * turned_r[i, size]
                    if forced:
                        for k in range(size):
                            added = rows[i, p, 1] + rows[i, p, 2] * (reached + (start + k) * h)
                            added += rows[i, p, 3] * spun[k] + rows[i, p, 4] * spun[k].conjugate()
                            x[i, k + 1] += added.imag
                            v[i, k + 1] += added.real
                    for k in range(size):
                        x[i, k + 1] *= inverse[i]
                        v[i, k + 1] += real[i] * x[i, k + 1]
                for j in range(n):
                    fast[j, 1:] = 0.0
                    for i in range(m):
                        weight = weights[j, i]
                        for k in range(1, size + 1):
                            fast[j, k] += weight * v[i, k]
                    for k in range(1 if start > 0 else 2, size + 1):
                        if fast[j, k - 1] * fast[j, k] > 0.0 or fast[j, k - 1] == 0.0:
                            continue
                        u = reached + (start + k - 1) * h
                        before = constant[p] + slope[p] * (u - h)
                        after = constant[p] + slope[p] * u
                        if wave[p] != 0.0:
                            before += (amplitude[p] * np.exp(1j * wave[p] * (u - h))).real
                            after += (amplitude[p] * np.exp(1j * wave[p] * u)).real
                        far0, far, first, second = 0.0, 0.0, 0.0, 0.0
                        for i in range(m):
                            square = poles[i].real ** 2 + poles[i].imag ** 2
                            twice, weight = 2.0 * real[i], weights[j, i]
                            far0 += weight * x[i, k - 1]
                            far += weight * x[i, k]
                            first += weight * (before + twice * v[i, k - 1] - square * x[i, k - 1])
                            second += weight * (after + twice * v[i, k] - square * x[i, k])
                        value = between(h, far0, fast[j, k - 1], first, far, fast[j, k], second)
                        turns[j, count[j]] = value
                        count[j] += 1
                        top[j] = max(top[j], value)
                        bottom[j] = min(bottom[j], value)
                x[:, 0], v[:, 0], fast[:, 0] = x[:, size], v[:, size], fast[:, size]
                if p == pieces - 1 and not forced and start + _LOOK <= steps:
                    ended = _nothing_larger(zr, zi, weights, inverse, top, bottom, enough)
                    if ended:
                        break
            if ended:
                break
            reached = length[p] if reached + span >= length[p] * (1.0 - 1e-12) else reached + span
    for j in range(n):
        turns[j, count[j]] = 0.0
        for i in range(m):
            turns[j, count[j]] += weights[j, i] * x[i, 0]
        count[j] += 1
    return turns, count


@njit(cache=True, error_model="numpy")
def _nothing_larger(  # type: ignore[no-untyped-def]
    zr, zi, weights, inverse, top, bottom, enough
):
    """Whether the rest of the ring-down can neither exceed an extreme nor do damage."""
    n, m = weights.shape
    for j in range(n):
        if top[j] - bottom[j] >= enough[j]:
            return False
        left = 0.0
        for i in range(m):
            left += abs(weights[j, i]) * np.hypot(zr[i], zi[i]) * inverse[i]
        if left > min(top[j], -bottom[j]):
            return False
    return True
