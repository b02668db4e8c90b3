"""Compiled samples of many oscillators, and of what they do to a joint."""

from __future__ import annotations

import numpy as np
from numba import njit

from picchio.core.arrays import ComplexArray, FloatArray
from picchio.vibration.oscillator_kernel import exponential

# Samples a cycle of the fastest mode. |g|^2 swings twice as fast: a top between two samples is
# at most 10 % above both, and at most 2.5 % above the parabola through it and its neighbours.
_PER_CYCLE = 10.0
_FAST = {"contract", "reassoc", "nsz", "arcp"}


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
    eta: FloatArray,
    shapes: FloatArray,
    push: FloatArray,
    dims: int,
    g: FloatArray,
    norm: FloatArray,
) -> float:
    """|g|^2 of a joint on the samples, into its row (joint, k), and its largest; g is scratch.

    `dims` is 1 where only the first column of `push` (n, 3) is not zero.
    """
    n = push.shape[0]
    count = norm.shape[1]
    largest = 0.0
    if dims == 1:
        for k in range(count):
            g[0, k] = 0.0
        for i in range(n):
            weight = shapes[joint, i] * push[i, 0]
            for k in range(count):
                g[0, k] += weight * eta[i, k]
        for k in range(count):
            norm[joint, k] = g[0, k] * g[0, k]
    else:
        a = shapes[joint, 0] * push[0, 0]
        b = shapes[joint, 0] * push[0, 1]
        c = shapes[joint, 0] * push[0, 2]
        for k in range(count):
            g[0, k], g[1, k], g[2, k] = a * eta[0, k], b * eta[0, k], c * eta[0, k]
        for i in range(1, n):
            a = shapes[joint, i] * push[i, 0]
            b = shapes[joint, i] * push[i, 1]
            c = shapes[joint, i] * push[i, 2]
            for k in range(count):
                value = eta[i, k]
                g[0, k] += a * value
                g[1, k] += b * value
                g[2, k] += c * value
        for k in range(count):
            x, y, z = g[0, k], g[1, k], g[2, k]
            norm[joint, k] = x * x + y * y + z * z
    for k in range(count):
        largest = max(largest, norm[joint, k])
    return largest
