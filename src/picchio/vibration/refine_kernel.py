"""Compiled Newton search for the top of a joint's response between two samples."""

from __future__ import annotations

import math

from numba import njit

from picchio.core.arrays import ComplexArray, FloatArray

_NEWTON = 40
# Of the bracket: the last step's own error is its square, and a maximum is off by the square of
# that, once what the step itself gains is added.
_PRECISION = 2e-5


@njit(cache=True, error_model="numpy", inline="always")
def piece_at(time: float, start: FloatArray) -> int:
    """The last piece of the force that has begun at a time, s."""
    p = 0
    while p + 1 < start.shape[0] and start[p + 1] <= time:
        p += 1
    return p


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
) -> float:
    """|g|^2 at the maximum in (a, b), and g (3,) there; Newton on its slope, in the bracket.

    Everything is in scalars: views into arrays cost more than the arithmetic.
    """
    n = poles.shape[0]
    width = b - a
    norm = 0.0
    for _ in range(_NEWTON):
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
            q0 = shapes[joint, i] * push[i, 0]
            q1 = shapes[joint, i] * push[i, 1]
            q2 = shapes[joint, i] * push[i, 2]
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
