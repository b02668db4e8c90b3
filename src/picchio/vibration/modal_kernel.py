"""Compiled modal analysis of small systems with a diagonal stiffness."""

from __future__ import annotations

import numpy as np
from numba import njit

from picchio.core.arrays import FloatArray

_SWEEPS = 30


@njit(cache=True, error_model="numpy")
def jacobi_eigh(a: FloatArray, vectors: FloatArray) -> None:
    """Eigenvalues onto the diagonal of `a` (n, n), eigenvectors into the columns of `vectors`.

    Cyclic Jacobi rotations (Golub and Van Loan, Matrix Computations, section 8.5): for n <= 7
    faster than LAPACK's overhead, and relatively accurate for positive definite matrices.
    """
    n = a.shape[0]
    for i in range(n):
        for j in range(n):
            vectors[i, j] = 1.0 if i == j else 0.0
    for _ in range(_SWEEPS):
        worst = 0.0
        for p in range(n - 1):
            for q in range(p + 1, n):
                off = a[p, q]
                scale = abs(a[p, p]) * abs(a[q, q])
                if off * off <= 1e-33 * scale:
                    continue
                worst = max(worst, off * off / scale if scale > 0.0 else 1.0)
                theta = 0.5 * (a[q, q] - a[p, p]) / off
                t = 1.0 / (abs(theta) + np.sqrt(theta * theta + 1.0))
                if theta < 0.0:
                    t = -t
                c = 1.0 / np.sqrt(t * t + 1.0)
                s = t * c
                for k in range(n):
                    akp, akq = a[k, p], a[k, q]
                    a[k, p], a[k, q] = c * akp - s * akq, s * akp + c * akq
                for k in range(n):
                    apk, aqk = a[p, k], a[q, k]
                    a[p, k], a[q, k] = c * apk - s * aqk, s * apk + c * aqk
                for k in range(n):
                    vkp, vkq = vectors[k, p], vectors[k, q]
                    vectors[k, p], vectors[k, q] = c * vkp - s * vkq, s * vkp + c * vkq
        if worst <= 1e-32:
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
        for j in range(n):
            symmetric = 0.5 * (mass[i, j] + mass[j, i])
            work[i, j] = symmetric / np.sqrt(stiffness[i] * stiffness[j])
    jacobi_eigh(work, vectors)
    good = True
    for k in range(n):
        # The k-th lowest frequency has the k-th largest eigenvalue.
        best = -1
        for i in range(n):
            if not np.isnan(work[i, i]) and (best < 0 or work[i, i] > work[best, best]):
                best = i
        if best < 0 or not work[best, best] > 0.0:
            good = False
            break
        omega[k] = 1.0 / np.sqrt(work[best, best])
        ratio[k] = 0.0
        for i in range(n):
            ratio[k] += joint_ratio[i] * vectors[i, best] ** 2
            shapes[i, k] = vectors[i, best] * omega[k] / np.sqrt(stiffness[i])
        work[best, best] = np.nan
    return good
