"""Compiled Newton search for the top of a joint's response between two samples."""

from __future__ import annotations

import numpy as np
from numba import njit

from picchio.core.arrays import ComplexArray, FloatArray
from picchio.vibration.oscillator_kernel import evaluate

_NEWTON = 40
# Of the bracket: a maximum is off by the square of this.
_PRECISION = 1e-5


@njit(cache=True, error_model="numpy")
def refine(
    joint: int,
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
    shapes: FloatArray,
    push: FloatArray,
    g: FloatArray,
    speed: FloatArray,
    change: FloatArray,
) -> float:
    """|g|^2 at the maximum in (a, b), and g there; Newton on its slope, kept in the bracket."""
    n, dims = push.shape
    width = b - a
    norm = 0.0
    for _ in range(_NEWTON):
        inside = t % total
        p = 0
        while p + 1 < start.shape[0] and start[p + 1] <= inside:
            p += 1
        u = inside - start[p]
        force = constant[p] + slope[p] * u
        if wave[p] != 0.0:
            force += (amplitude[p] * np.exp(1j * wave[p] * u)).real
        norm, first, second = 0.0, 0.0, 0.0
        for d in range(dims):
            g[d], speed[d], change[d] = 0.0, 0.0, 0.0
        for i in range(n):
            pole = poles[i]
            z = evaluate(pole, rows[i, p], wave[p], u)
            rate = pole * z
            x = z.imag / pole.imag * shapes[joint, i]
            v = rate.imag / pole.imag * shapes[joint, i]
            acceleration = ((pole * rate).imag / pole.imag + force) * shapes[joint, i]
            for d in range(dims):
                g[d] += x * push[i, d]
                speed[d] += v * push[i, d]
                change[d] += acceleration * push[i, d]
        for d in range(dims):
            norm += g[d] * g[d]
            first += g[d] * speed[d]
            second += speed[d] * speed[d] + g[d] * change[d]
        if first > 0.0:
            a = t
        else:
            b = t
        new = t - first / second if second < 0.0 else 0.5 * (a + b)
        newton = second < 0.0 and a <= new <= b
        if not newton:
            new = 0.5 * (a + b)
        step = abs(new - t)
        t = new
        if step <= _PRECISION * width:
            if newton:  # what the last, unevaluated step would still have gained
                norm -= first * first / second
            break
    return norm
