"""Compiled samples of many oscillators, and of what they do to a joint."""

from __future__ import annotations

import numpy as np
from numba import njit

from picchio.core.arrays import ComplexArray, FloatArray

# Samples a cycle of the fastest mode: a peak between two samples is at most 2 % above both.
_PER_CYCLE = 16.0


@njit(cache=True, error_model="numpy")
def steps_of(duration: float, rate: float) -> int:
    """How many samples a piece of `duration` s takes at `rate` rad/s."""
    return max(1, int(np.ceil(duration * rate * (_PER_CYCLE / (2.0 * np.pi)))))


@njit(cache=True, error_model="numpy")
def sample(
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
        steps = steps_of(duration[p], max(fastest, wave[p]))
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
def joint_norms(
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
