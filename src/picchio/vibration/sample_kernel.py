"""Compiled samples of many oscillators: coarse everywhere, fine where a peak may hide."""

from __future__ import annotations

import numpy as np
from numba import njit

from picchio.core.arrays import ComplexArray, FloatArray

# Coarse samples a cycle of the fastest mode. Where what happens between two could exceed the
# largest sample, CUTS finer ones are taken, 16 a cycle: a peak between two of those is at most
# 2 % above both.
_PER_CYCLE = 4.0
CUTS = 4


@njit(cache=True, error_model="numpy")
def steps_of(duration: float, rate: float) -> int:
    """How many coarse samples a piece of `duration` s takes at `rate` rad/s."""
    return max(1, int(np.ceil(duration * rate * (_PER_CYCLE / (2.0 * np.pi)))))


@njit(cache=True, error_model="numpy")
def sample(
    poles: ComplexArray,
    rows: ComplexArray,
    duration: FloatArray,
    wave: FloatArray,
    fastest: float,
    free: ComplexArray,
    eta: FloatArray,
    time: FloatArray,
    owner: FloatArray,
    fine: ComplexArray,
    bend: FloatArray,
) -> None:
    """Coarse samples over all pieces, by recurrence.

    Fills the free part of the states (n, k), the deflections `eta` (n, k), the times (k,), the
    piece each sample belongs to (k,), the decay over one cut (n, m), and `bend` (n, m): by how
    much a deflection can leave the straight line between two samples.
    """
    count, began = 0, 0.0
    for p in range(duration.shape[0]):
        steps = steps_of(duration[p], max(fastest, wave[p]))
        h = duration[p] / steps
        for i in range(poles.shape[0]):
            scale = 1.0 / poles[i].imag
            fine[i, p] = np.exp(poles[i] * (h / CUTS))
            decay = fine[i, p] ** 2
            decay *= decay
            turn = min(2.0, 0.125 * (abs(poles[i]) * h) ** 2)
            bend[i, p] = turn * abs(rows[i, p, 0]) * scale
            if wave[p] != 0.0:
                most = min(2.0, 0.125 * (wave[p] * h) ** 2)
                bend[i, p] += most * (abs(rows[i, p, 3]) + abs(rows[i, p, 4])) * scale
            z = rows[i, p, 0]
            level, rise = rows[i, p, 1].imag, rows[i, p, 2].imag * h
            for k in range(steps):
                free[i, count + k] = z
                eta[i, count + k] = (z.imag + level + rise * k) * scale
                z *= decay
            if wave[p] != 0.0:
                spin = np.exp(1j * wave[p] * h)
                plus, minus = rows[i, p, 3], rows[i, p, 4]
                for k in range(steps):
                    eta[i, count + k] += (plus + minus).imag * scale
                    plus *= spin
                    minus *= spin.conjugate()
        for k in range(steps):
            time[count + k] = began + h * k
            owner[count + k] = p
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


@njit(cache=True, error_model="numpy")
def cut(
    joint: int,
    k: int,
    p: int,
    u: float,
    h: float,
    poles: ComplexArray,
    rows: ComplexArray,
    wave: FloatArray,
    free: ComplexArray,
    fine: ComplexArray,
    shapes: FloatArray,
    push: FloatArray,
    cuts: FloatArray,
) -> None:
    """|g|^2 of a joint at the ends of the cuts after coarse sample k: cuts[1:]."""
    n, dims = push.shape
    x = np.zeros((CUTS, dims))
    for i in range(n):
        z = free[i, k]
        weight = shapes[joint, i] / poles[i].imag
        for c in range(CUTS):
            z *= fine[i, p]
            at = u + h * (c + 1)
            total = z.imag + rows[i, p, 1].imag + rows[i, p, 2].imag * at
            if wave[p] != 0.0:
                turn = np.exp(1j * wave[p] * at)
                total += (rows[i, p, 3] * turn + rows[i, p, 4] * turn.conjugate()).imag
            for d in range(dims):
                x[c, d] += total * weight * push[i, d]
    for c in range(CUTS):
        cuts[c + 1] = 0.0
        for d in range(dims):
            cuts[c + 1] += x[c, d] * x[c, d]
