"""Compiled samples of many oscillators, and of what they do to a joint."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from picchio.core.arrays import ComplexArray, FloatArray
from picchio.vibration.oscillator_kernel import exponential

# Samples a cycle of the fastest mode. |g|^2 swings twice as fast: a top between two samples is
# at most 10 % above both, unless modes nearly cancel (see `top_kernel`).
_PER_CYCLE = 10.0
_FAST = {"contract", "reassoc", "nsz", "arcp"}


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
    for d in range(dims):
        weight = shapes[joint, 0] * push[0, d]
        for k in range(count):
            g[d, k] = weight * eta[0, k]
        i = 1
        while i + 1 < n:  # two modes at a time: half as many ways to memory and back
            first, second = shapes[joint, i] * push[i, d], shapes[joint, i + 1] * push[i + 1, d]
            for k in range(count):
                g[d, k] += first * eta[i, k] + second * eta[i + 1, k]
            i += 2
        if i < n:
            weight = shapes[joint, i] * push[i, d]
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
