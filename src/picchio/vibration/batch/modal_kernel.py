"""Compiled modes of small systems with a diagonal stiffness, and each mode's closed-form response.

An oscillator eta'' + 2 zeta w eta' + w^2 eta = F is the complex pole z' = pole z + F with
eta = Im(z) / Im(pole). On a piece of the force z is one row of coefficients:

    z(u) = c0 exp(pole u) + c1 + c2 u + c3 exp(i wave u) + c4 exp(-i wave u).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from picchio.core.arrays import ComplexArray, FloatArray

_SWEEPS = 30
# Off-diagonal terms, squared, over the product of their diagonal ones: no rotation below the
# first, no further sweep below the second.
_NOTHING = 1e-30
_SMALL = 1e-17


@njit(cache=True, error_model="numpy")
def jacobi_eigh(a: FloatArray, vectors: FloatArray) -> None:
    """Eigenvalues onto the diagonal of `a` (n, n), eigenvectors into the rows of `vectors`.

    Cyclic Jacobi rotations (Golub and Van Loan, Matrix Computations, section 8.5): for n <= 7
    faster than LAPACK's overhead, and relatively accurate for positive definite matrices. Only
    the upper triangle of `a` is read, and destroyed.
    """
    n = a.shape[0]
    for i in range(n):
        for j in range(n):
            vectors[i, j] = 0.0
        vectors[i, i] = 1.0
    for _ in range(_SWEEPS):
        worst = 0.0
        for p in range(n - 1):
            for q in range(p + 1, n):
                off, app, aqq = a[p, q], a[p, p], a[q, q]
                scale = abs(app * aqq)
                if off * off <= _NOTHING * scale:
                    continue
                worst = max(worst, off * off / scale if scale > 0.0 else 1.0)
                theta = 0.5 * (aqq - app) / off
                t = 1.0 / (abs(theta) + np.sqrt(theta * theta + 1.0))
                if theta < 0.0:
                    t = -t
                c = 1.0 / np.sqrt(t * t + 1.0)
                s = t * c
                a[p, p], a[q, q], a[p, q] = app - t * off, aqq + t * off, 0.0
                for k in range(p):
                    x, y = a[k, p], a[k, q]
                    a[k, p], a[k, q] = c * x - s * y, s * x + c * y
                for k in range(p + 1, q):
                    x, y = a[p, k], a[k, q]
                    a[p, k], a[k, q] = c * x - s * y, s * x + c * y
                for k in range(q + 1, n):
                    x, y = a[p, k], a[q, k]
                    a[p, k], a[q, k] = c * x - s * y, s * x + c * y
                for k in range(n):
                    x, y = vectors[p, k], vectors[q, k]
                    vectors[p, k], vectors[q, k] = c * x - s * y, s * x + c * y
        # What is left after a sweep is the square of what was there before it.
        if worst <= _SMALL:
            break


@njit(cache=True, error_model="numpy")
def modes_of(
    mass: FloatArray,
    stiffness: FloatArray,
    joint_ratio: FloatArray,
    work: FloatArray,
    vectors: FloatArray,
    omega: FloatArray,
    ratio: FloatArray,
    shapes: FloatArray,
    frequency: FloatArray,
    poles: ComplexArray,
) -> bool:
    """Undamped modes of M x'' + diag(k) x = 0, ascending, with S^T M S = I; Hz, and their poles.

    From B = K^-1/2 M K^-1/2 with B V = V diag(1 / omega^2): S = K^-1/2 V diag(omega). A mode's
    damping ratio is the joints' weighted by strain energy, which is V squared.

    Returns:
        whether the mass matrix is positive definite, and every mode underdamped.
    """
    n = mass.shape[0]
    for i in range(n):
        ratio[i] = 1.0 / np.sqrt(stiffness[i])
    for i in range(n):
        for j in range(i, n):
            work[i, j] = 0.5 * (mass[i, j] + mass[j, i]) * (ratio[i] * ratio[j])
    jacobi_eigh(work, vectors)
    for k in range(n):
        # The k-th lowest frequency has the k-th largest eigenvalue.
        best = k
        for i in range(k + 1, n):
            if not work[i, i] <= work[best, best]:
                best = i
        largest = work[best, best]
        if not largest > 0.0:
            return False
        work[best, best] = work[k, k]
        omega[k] = 1.0 / np.sqrt(largest)
        for i in range(n):
            vectors[k, i], vectors[best, i] = vectors[best, i], vectors[k, i]
            shapes[i, k] = vectors[k, i] * omega[k] * ratio[i]
    for k in range(n):
        ratio[k] = 0.0
        for i in range(n):
            ratio[k] += joint_ratio[i] * vectors[k, i] ** 2
    under = True
    for k in range(n):
        frequency[k] = omega[k] / (2.0 * np.pi)
        under = under and 0.0 < ratio[k] < 1.0 - 1e-6
        poles[k] = complex(-ratio[k] * omega[k], omega[k] * np.sqrt(1.0 - ratio[k] ** 2))
    return under


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
