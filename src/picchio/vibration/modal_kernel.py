"""Compiled modal analysis of small systems with a diagonal stiffness."""

from __future__ import annotations

import numpy as np
from numba import njit

from picchio.core.arrays import FloatArray

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
) -> bool:
    """Undamped modes of M x'' + diag(k) x = 0, ascending, with S^T M S = I.

    From B = K^-1/2 M K^-1/2 with B V = V diag(1 / omega^2): S = K^-1/2 V diag(omega). A mode's
    damping ratio is the joints' weighted by strain energy, which is V squared.

    Returns:
        whether the mass matrix is positive definite.
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
    return True
