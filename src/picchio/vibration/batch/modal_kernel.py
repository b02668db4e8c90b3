"""Compiled modes of small systems with a diagonal stiffness, and each mode's closed-form response.

An oscillator eta'' + 2 zeta w eta' + w^2 eta = F is the complex pole z' = pole z + F with
eta = Im(z) / Im(pole). On a piece of the force z is one row of coefficients:

    z(u) = c0 exp(pole u) + c1 + c2 u + c3 exp(i wave u) + c4 exp(-i wave u).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numba.core.cpu import CPUTargetOptions

from picchio.core.arrays import ComplexArray, FloatArray

_SWEEPS = 30
KERNEL: dict[str, Any] = {"cache": True, "error_model": "numpy", "fastmath": {"contract"}}
if hasattr(CPUTargetOptions, "_nrt"):  # a switch of Numba's own, that need not stay
    KERNEL["_nrt"] = False
"""How innermost functions are compiled. Products are added without rounding between them, which
loses nothing. References to arrays are not counted there, so that none can be made: a count each
way takes longer than the arithmetic."""
# Off-diagonal terms, squared, over the product of their diagonal ones: no rotation below the
# first, no further sweep below the second.
_NOTHING = 1e-30
_SMALL = 1e-17


@njit(**KERNEL)
def _angles(  # type: ignore[no-untyped-def]
    app, aqq, apq, cosine, sine
):
    """Of each matrix, the rotation that makes `apq` zero; how many are not diagonal there yet."""
    far = 0
    for k in range(app.shape[0]):
        x, y, off = app[k], aqq[k], apq[k]
        scale, square, half = abs(x * y), off * off, 0.5 * (y - x)
        turns = square > _NOTHING * scale
        size = abs(half) + np.sqrt(half * half + square)
        t = off / (size if half >= 0.0 else -size) if turns else 0.0
        c = 1.0 / np.sqrt(t * t + 1.0)
        cosine[k], sine[k] = c, t * c
        app[k], aqq[k], apq[k] = x - t * off, y + t * off, 0.0 if turns else off
        far += 1 if square > _SMALL * scale else 0
    return far


@njit(**KERNEL)
def _turn(first, second, cosine, sine):  # type: ignore[no-untyped-def]
    """Rotate two rows (l,) into each other, each lane by its own angle."""
    for k in range(first.shape[0]):
        x, y = first[k], second[k]
        first[k], second[k] = cosine[k] * x - sine[k] * y, sine[k] * x + cosine[k] * y


@njit(cache=True, error_model="numpy")
def _jacobi_eigh(a: FloatArray, vectors: FloatArray) -> None:
    """Eigenvalues of l matrices onto the diagonals of `a` (n, n, l); vectors into rows (n, n, l).

    Cyclic Jacobi rotations (Golub and Van Loan, Matrix Computations, section 8.5), of all
    matrices side by side on vector units, until the last one is diagonal. They are relatively
    accurate for positive definite matrices. Only the upper triangles are read, and destroyed.
    """
    n, _, lanes = a.shape
    cosine, sine = np.empty(lanes), np.empty(lanes)
    for i in range(n):
        for j in range(n):
            for k in range(lanes):
                vectors[i, j, k] = 1.0 if i == j else 0.0
    for _ in range(_SWEEPS):
        far = 0
        for p in range(n - 1):
            for q in range(p + 1, n):
                far += _angles(a[p, p], a[q, q], a[p, q], cosine, sine)
                for k in range(n):
                    if k < p:
                        _turn(a[k, p], a[k, q], cosine, sine)
                    elif p < k < q:
                        _turn(a[p, k], a[k, q], cosine, sine)
                    elif k > q:
                        _turn(a[p, k], a[q, k], cosine, sine)
                    _turn(vectors[p, k], vectors[q, k], cosine, sine)
        # What is left after a sweep is the square of what was there before it.
        if far == 0:
            break


@njit(cache=True, error_model="numpy")
def decompose(
    mass: FloatArray, stiffness: FloatArray, values: FloatArray, vectors: FloatArray
) -> None:
    """B = K^-1/2 M K^-1/2 of l systems, decomposed: B V = V diag(values).

    Args:
        mass: (l, n, n) kg m^2.
        stiffness: (l, n) N m/rad.
        values: (n, n, l) out, on the diagonals; the rest is scratch.
        vectors: (n, n, l) out, in rows.
    """
    lanes, n = stiffness.shape
    for s in range(lanes):
        for i in range(n):
            for j in range(i, n):
                both = 0.5 * (mass[s, i, j] + mass[s, j, i])
                values[i, j, s] = both / np.sqrt(stiffness[s, i] * stiffness[s, j])
    _jacobi_eigh(values, vectors)


@njit(**KERNEL)
def modes_of(
    s: int,
    values: FloatArray,
    vectors: FloatArray,
    stiffness: FloatArray,
    joint_ratio: FloatArray,
    omega: FloatArray,
    shapes: FloatArray,
    frequency: FloatArray,
    poles: ComplexArray,
) -> bool:
    """Undamped modes of M x'' + diag(k) x = 0, ascending, with S^T M S = I; Hz, and their poles.

    From what `decompose` made of system s: values are 1 / omega^2, and S = K^-1/2 V diag(omega).
    A mode's damping ratio is the joints' weighted by strain energy, which is V squared.

    Returns:
        whether the mass matrix is positive definite, and every mode underdamped.
    """
    n = stiffness.shape[0]
    under = True
    for k in range(n):
        # The k-th lowest frequency has the k-th largest eigenvalue.
        best = k
        for i in range(k + 1, n):
            if not values[i, i, s] <= values[best, best, s]:
                best = i
        largest = values[best, best, s]
        if not largest > 0.0:
            return False
        values[best, best, s] = values[k, k, s]
        omega[k] = 1.0 / np.sqrt(largest)
        ratio = 0.0
        for i in range(n):
            part = vectors[best, i, s]
            vectors[best, i, s] = vectors[k, i, s]
            shapes[i, k] = part * omega[k] / np.sqrt(stiffness[i])
            ratio += joint_ratio[i] * part * part
        under = under and 0.0 < ratio < 1.0 - 1e-6
        poles[k] = complex(-ratio * omega[k], omega[k] * np.sqrt(1.0 - ratio * ratio))
    for k in range(n):
        frequency[k] = omega[k] / (2.0 * np.pi)
    return under


@njit(**KERNEL)
def exponential(pole: complex, u: float) -> complex:
    """exp(pole u); the library's complex exponential takes twice as long over special cases."""
    size, angle = math.exp(pole.real * u), pole.imag * u
    return complex(size * math.cos(angle), size * math.sin(angle))


@njit(**KERNEL)
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
