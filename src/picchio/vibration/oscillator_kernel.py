"""Compiled closed-form response of single oscillators to a force in pieces.

An oscillator eta'' + 2 zeta w eta' + w^2 eta = F is the complex pole z' = pole z + F with
eta = Im(z) / Im(pole). On a piece of the force z is one row of coefficients:

    z(u) = c0 exp(pole u) + c1 + c2 u + c3 exp(i wave u) + c4 exp(-i wave u).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from picchio.core.arrays import ComplexArray, FloatArray


@njit(cache=True, error_model="numpy")
def evaluate(pole: complex, row: ComplexArray, wave: float, u: float) -> complex:
    """The state z at `u` seconds into a piece."""
    z = row[0] * np.exp(pole * u) + row[1] + row[2] * u
    if wave != 0.0:
        turn = np.exp(1j * wave * u)
        z += row[3] * turn + row[4] * turn.conjugate()
    return z


@njit(cache=True, error_model="numpy")
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
        for p in range(pieces):
            row = rows[i, p]
            row[2] = -slope[p] / pole
            row[1] = (row[2] - constant[p]) / pole
            row[3] = 0.0
            row[4] = 0.0
            if wave[p] != 0.0:
                row[3] = 0.5 * amplitude[p] / (1j * wave[p] - pole)
                row[4] = 0.5 * amplitude[p].conjugate() / (-1j * wave[p] - pole)
            decay = np.exp(pole * duration[p]) if duration[p] < np.inf else 0.0j
            row[5] = decay
            moved = row[1] + row[2] * duration[p] if duration[p] < np.inf else 0.0j
            if wave[p] != 0.0:
                turn = np.exp(1j * wave[p] * duration[p])
                moved += row[3] * turn + row[4] * turn.conjugate()
            row[6] = moved
        # From rest; then once more from the state that repeats after one period.
        z = 0.0j
        kept = 1.0 + 0.0j
        for turn_number in range(2 if periodic else 1):
            if turn_number == 1:
                z /= 1.0 - kept
            for p in range(pieces):
                row = rows[i, p]
                row[0] = z - row[1] - row[3] - row[4]
                z = row[0] * row[5] + row[6]
                kept *= row[5]
