"""Products of 3-vectors and 3 x 3 matrices and a small solver, for compiled code.

Results go into arrays that are handed in. Loops are written out: numba takes seconds to
compile an assignment to a slice.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def copy(source, out):  # type: ignore[no-untyped-def]
    """Out = source, both (n,)."""
    for i in range(source.shape[0]):
        out[i] = source[i]


@njit(cache=True)
def copy_matrix(source, out):  # type: ignore[no-untyped-def]
    """Out = source, both (n, m)."""
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            out[i, j] = source[i, j]


@njit(cache=True)
def turn(a, b, out):  # type: ignore[no-untyped-def]
    """Out = a @ b, all (3, 3)."""
    for r in range(3):
        for c in range(3):
            out[r, c] = a[r, 0] * b[0, c] + a[r, 1] * b[1, c] + a[r, 2] * b[2, c]


@njit(cache=True)
def rotate(a, v, out):  # type: ignore[no-untyped-def]
    """Out = a @ v, (3, 3) and (3,)."""
    for r in range(3):
        out[r] = a[r, 0] * v[0] + a[r, 1] * v[1] + a[r, 2] * v[2]


@njit(cache=True)
def cross(a, b, out):  # type: ignore[no-untyped-def]
    """Out = a x b, all (3,)."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@njit(cache=True)
def turn_about(a, angle, out):  # type: ignore[no-untyped-def]
    """Out (3, 3) = the rotation about the unit vector a (3,) by an angle in rad."""
    c, s = np.cos(angle), np.sin(angle)
    v = 1.0 - c
    out[0, 0] = c + a[0] * a[0] * v
    out[0, 1] = a[0] * a[1] * v - a[2] * s
    out[0, 2] = a[0] * a[2] * v + a[1] * s
    out[1, 0] = a[1] * a[0] * v + a[2] * s
    out[1, 1] = c + a[1] * a[1] * v
    out[1, 2] = a[1] * a[2] * v - a[0] * s
    out[2, 0] = a[2] * a[0] * v - a[1] * s
    out[2, 1] = a[2] * a[1] * v + a[0] * s
    out[2, 2] = c + a[2] * a[2] * v


@njit(cache=True)
def cholesky_solve(a, b):  # type: ignore[no-untyped-def]
    """Solve a x = b in place (x in b) for a symmetric positive definite a (n, n); a is lost."""
    n = b.shape[0]
    for i in range(n):
        for j in range(i + 1):
            total = a[i, j]
            for r in range(j):
                total -= a[i, r] * a[j, r]
            # Rounding can push a pivot of a singular matrix below zero.
            a[i, j] = np.sqrt(max(total, 1e-300)) if i == j else total / a[j, j]
    for i in range(n):
        for r in range(i):
            b[i] -= a[i, r] * b[r]
        b[i] /= a[i, i]
    for i in range(n - 1, -1, -1):
        for r in range(i + 1, n):
            b[i] -= a[r, i] * b[r]
        b[i] /= a[i, i]
