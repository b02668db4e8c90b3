"""Compiled closed-form response of single oscillators to a force in pieces.

An oscillator eta'' + 2 zeta w eta' + w^2 eta = F is the complex pole z' = pole z + F with
eta = Im(z) / Im(pole). On a piece of the force z is one row of coefficients:

    z(u) = c0 exp(pole u) + c1 + c2 u + c3 exp(i wave u) + c4 exp(-i wave u).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from picchio.core.arrays import ComplexArray, FloatArray


@njit(cache=True, error_model="numpy", inline="always")
def exponential(pole: complex, u: float) -> complex:
    """exp(pole u); the library's complex exponential takes twice as long over special cases."""
    size, angle = math.exp(pole.real * u), pole.imag * u
    return complex(size * math.cos(angle), size * math.sin(angle))


@njit(cache=True, error_model="numpy", inline="always")
def coefficients(
    poles: ComplexArray,
    duration: FloatArray,
    constant: FloatArray,
    slope: FloatArray,
    amplitude: ComplexArray,
    wave: FloatArray,
    periodic: bool,
    rows: ComplexArray,
) -> None:
    """Coefficients (n, m, 7) of every pole on every piece, from rest or of the steady state.

    Columns 5 and 6 are scratch: the piece's decay, and its particular solution at its end. The
    last piece may be endless where the motion is not periodic.
    """
    pieces = duration.shape[0]
    for i in range(poles.shape[0]):
        pole = poles[i]
        inverse = pole.conjugate() / (pole.real * pole.real + pole.imag * pole.imag)
        for p in range(pieces):
            rise = -slope[p] * inverse
            level = (rise - constant[p]) * inverse
            rows[i, p, 1], rows[i, p, 2] = level, rise
            plus, minus = 0.0j, 0.0j
            decay, moved = 0.0j, 0.0j
            endless = duration[p] == np.inf
            if not endless:
                decay = exponential(pole, duration[p])
                moved = level + rise * duration[p]
            if wave[p] != 0.0:
                plus = 0.5 * amplitude[p] / (1j * wave[p] - pole)
                minus = 0.5 * amplitude[p].conjugate() / (-1j * wave[p] - pole)
                turn = exponential(complex(0.0, wave[p]), duration[p])
                moved += plus * turn + minus * turn.conjugate()
            rows[i, p, 3], rows[i, p, 4] = plus, minus
            rows[i, p, 5], rows[i, p, 6] = decay, moved
        # From rest; then once more from the state that repeats after one period.
        z = 0.0j
        kept = 1.0 + 0.0j
        for turn_number in range(2 if periodic else 1):
            if turn_number == 1:
                z /= 1.0 - kept
            for p in range(pieces):
                free = z - rows[i, p, 1] - rows[i, p, 3] - rows[i, p, 4]
                rows[i, p, 0] = free
                z = free * rows[i, p, 5] + rows[i, p, 6]
                kept *= rows[i, p, 5]
