"""Compiled forward kinematics of a chain: how far the tool is from a point and an axis.

Products of small matrices are written out, into arrays that are handed in: that runs several times
faster than calls into BLAS, and numba takes seconds to compile an assignment to a slice.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def forward(tables, q, residual, jacobian, target, axis, weight):  # type: ignore[no-untyped-def]
    """Fill the residual (6,) and its Jacobian (6, k); the axis rows are zero if weight is zero.

    Args:
        tables: rotation, offset, joint axis, slides, follow, shift, tool axis of a `Chain`.
        q: (k,) coordinates.
        residual: (6,) out: position error in m, then weight x axis error.
        jacobian: (6, k) out.
        target: (3,) m.
        axis: (3,) unit.
        weight: m, a length that makes angles comparable to distances.
    """
    rotation, offset, axes, slides, follow, shift, tool_axis = tables
    m, k = follow.shape
    turned, other, spin = np.zeros((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    turned[0, 0] = turned[1, 1] = turned[2, 2] = 1.0
    place, arm, linear, angular = np.zeros(3), np.empty(3), np.empty(3), np.empty(3)
    spins, origins = np.empty((m, 3)), np.empty((m, 3))
    for i in range(m):
        rotate(turned, offset[i], arm)
        for r in range(3):
            place[r] += arm[r]
        turn(turned, rotation[i], other)
        rotate(other, axes[i], spins[i])
        position = shift[i]
        for j in range(k):
            position += follow[i, j] * q[j]
        if slides[i]:
            for r in range(3):
                place[r] += spins[i, r] * position
            copy_matrix(other, turned)
        else:
            turn_about(axes[i], position, spin)
            turn(other, spin, turned)
        copy(place, origins[i])
    rotate(turned, offset[m], arm)
    for r in range(3):
        place[r] += arm[r]
    pointing, nothing = np.empty(3), np.zeros(3)
    rotate(rotation[m], tool_axis, arm)
    rotate(turned, arm, pointing)
    for r in range(3):
        residual[r] = place[r] - target[r]
        residual[r + 3] = weight * (pointing[r] - axis[r])
    for r in range(6):
        for j in range(k):
            jacobian[r, j] = 0.0
    for i in range(m):
        if slides[i]:
            copy(spins[i], linear)
            copy(nothing, angular)
        else:
            for r in range(3):
                arm[r] = place[r] - origins[i, r]
            cross(spins[i], arm, linear)
            cross(spins[i], pointing, angular)
        for j in range(k):
            if follow[i, j] != 0.0:
                for r in range(3):
                    jacobian[r, j] += follow[i, j] * linear[r]
                    jacobian[r + 3, j] += follow[i, j] * weight * angular[r]


@njit(cache=True)
def normal_equations(jacobian, residual, normal, gradient):  # type: ignore[no-untyped-def]
    """Fill J^T J (k, k) and J^T r (k,); return the largest diagonal entry, at least 1e-12."""
    rows, k = jacobian.shape
    largest = 1e-12
    for i in range(k):
        total = 0.0
        for r in range(rows):
            total += jacobian[r, i] * residual[r]
        gradient[i] = total
        for j in range(i + 1):
            total = 0.0
            for r in range(rows):
                total += jacobian[r, i] * jacobian[r, j]
            normal[i, j] = total
            normal[j, i] = total
        largest = max(largest, normal[i, i])
    return largest


@njit(cache=True)
def square(vector):  # type: ignore[no-untyped-def]
    """Sum of squares."""
    total = 0.0
    for value in vector:
        total += value * value
    return total


@njit(cache=True)
def gap(a, b):  # type: ignore[no-untyped-def]
    """Sum of squared differences."""
    total = 0.0
    for i in range(a.shape[0]):
        total += (a[i] - b[i]) ** 2
    return total


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
