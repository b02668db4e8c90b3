"""Compiled turning points of a rivet: the response from rest, ring-down included, turn by turn."""

from __future__ import annotations

import numpy as np
from numba import njit

from picchio.core.arrays import ComplexArray, FloatArray, IndexArray
from picchio.vibration.batch.modal_kernel import coefficients
from picchio.vibration.closed_form.response import RING_DOWN_LEVEL

# Samples a cycle of the fastest mode that lives: a turn's value is then off by 1e-7 of it.
_PER_CYCLE = 16.0
# A mode asks for its own step until its free decay has fallen to exp(-16) = 1e-7.
_DECAYED = 16.0
# Samples of one response, 80 MB a joint: a mode almost without damping takes more.
_MOST = 10_000_000
# Samples between two looks whether anything larger can still come.
_LOOK = 64


@njit(cache=True, error_model="numpy")
def steps_until(poles: ComplexArray, wave: float, reached: float, length: float):  # type: ignore[no-untyped-def]
    """The next stretch of a piece: how long it is, s, and how many samples it takes.

    The fastest mode that lives at `reached` s sets the step until it has died.
    """
    rate, life = wave, length if wave > 0.0 else reached
    slowest = np.inf
    for i in range(poles.shape[0]):
        own = min(_DECAYED / -poles[i].real, length)
        speed = abs(poles[i])
        slowest = min(slowest, speed)
        if own > reached and speed > rate:
            rate, life = speed, own
    if life <= reached:  # all have died: the slowest leads to the end
        rate, life = slowest, length
    span = life - reached
    return span, max(1, int(np.ceil(span * rate * (_PER_CYCLE / (2.0 * np.pi)))))


@njit(cache=True, error_model="numpy")
def most_samples(poles: ComplexArray, wave: FloatArray, length: FloatArray) -> int:
    """How many samples all pieces take; no joint turns more often."""
    count = 2
    for p in range(length.shape[0]):
        reached = 0.0
        while reached < length[p]:
            span, steps = steps_until(poles, wave[p], reached, length[p])
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
        if abs(new - s) < 1e-6:
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
    most = most_samples(poles, wave, length)
    if most > _MOST:
        return np.empty((n, 0)), np.zeros(n, dtype=np.int64)
    turns = np.empty((n, most))
    count = np.ones(n, dtype=np.int64)
    turns[:, 0] = 0.0
    decay, z = np.empty(m, np.complex128), np.empty(m, np.complex128)
    old, now = np.empty((m, 2)), np.empty((m, 2))
    x0, v0 = np.zeros(n), np.zeros(n)
    top, bottom = np.zeros(n), np.zeros(n)
    inverse = np.empty(m)
    for i in range(m):
        inverse[i] = 1.0 / poles[i].imag
    for p in range(pieces):
        reached = 0.0
        while reached < length[p]:
            span, steps = steps_until(poles, wave[p], reached, length[p])
            if span <= 0.0:
                break
            h = span / steps
            for i in range(m):
                decay[i] = np.exp(poles[i] * h)
                z[i] = rows[i, p, 0] * np.exp(poles[i] * reached)
            spin, turn = 1.0 + 0.0j, 1.0 + 0.0j
            if wave[p] != 0.0:
                spin, turn = np.exp(1j * wave[p] * h), np.exp(1j * wave[p] * reached)
            ended = False
            for k in range(steps + 1):
                u = reached + k * h
                for i in range(m):
                    whole = z[i] + rows[i, p, 1] + rows[i, p, 2] * u
                    if wave[p] != 0.0:
                        whole += rows[i, p, 3] * turn + rows[i, p, 4] * turn.conjugate()
                    now[i, 0] = whole.imag * inverse[i]
                    now[i, 1] = whole.real + poles[i].real * now[i, 0]
                    z[i] *= decay[i]
                turn *= spin
                for j in range(n):
                    x, v = 0.0, 0.0
                    for i in range(m):
                        x += weights[j, i] * now[i, 0]
                        v += weights[j, i] * now[i, 1]
                    if k > 0 and v0[j] * v <= 0.0 and v0[j] != 0.0:
                        first, second = 0.0, 0.0
                        before = constant[p] + slope[p] * (u - h)
                        after = constant[p] + slope[p] * u
                        if wave[p] != 0.0:
                            before += (amplitude[p] * np.exp(1j * wave[p] * (u - h))).real
                            after += (amplitude[p] * np.exp(1j * wave[p] * u)).real
                        for i in range(m):
                            size = poles[i].real ** 2 + poles[i].imag ** 2
                            twice = 2.0 * poles[i].real
                            first += weights[j, i] * (before + twice * old[i, 1] - size * old[i, 0])
                            second += weights[j, i] * (after + twice * now[i, 1] - size * now[i, 0])
                        value = between(h, x0[j], v0[j], first, x, v, second)
                        turns[j, count[j]] = value
                        count[j] += 1
                        top[j] = max(top[j], value)
                        bottom[j] = min(bottom[j], value)
                    x0[j], v0[j] = x, v
                for i in range(m):
                    old[i, 0], old[i, 1] = now[i, 0], now[i, 1]
                if p == pieces - 1 and k % _LOOK == _LOOK - 1 and k < steps:
                    ended = _nothing_larger(z, rows, p, weights, inverse, top, bottom, enough)
                    if ended:
                        break
            if ended:
                break
            reached = length[p] if reached + span >= length[p] * (1.0 - 1e-12) else reached + span
    for j in range(n):
        turns[j, count[j]] = x0[j]
        count[j] += 1
    return turns, count


@njit(cache=True, error_model="numpy")
def _nothing_larger(  # type: ignore[no-untyped-def]
    z, rows, p, weights, inverse, top, bottom, enough
):
    """Whether the rest of the ring-down can neither exceed an extreme nor do damage."""
    n, m = weights.shape
    for i in range(m):
        if rows[i, p, 1] != 0.0 or rows[i, p, 2] != 0.0:
            return False
    for j in range(n):
        if top[j] - bottom[j] >= enough[j]:
            return False
        left = 0.0
        for i in range(m):
            left += abs(weights[j, i]) * abs(z[i]) * inverse[i]
        if left > min(top[j], -bottom[j]):
            return False
    return True
