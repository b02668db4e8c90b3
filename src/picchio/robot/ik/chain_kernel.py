"""Compiled forward kinematics of a chain: how far the tool is from a point and an axis.

Products of small matrices are written out: that compiles and runs several times faster than
calls into BLAS.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from picchio.robot.ik.small_matrices import copy, copy_matrix, cross, rotate, turn, turn_about


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
    turned, other, spin = np.eye(3), np.empty((3, 3)), np.empty((3, 3))
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
def places_of(tables, q, found):  # type: ignore[no-untyped-def]
    """Where the tool is: fill found (p, 3) in m for coordinates (p, k); tables as of `forward`."""
    nothing = np.zeros(3)
    residual, jacobian = np.empty(6), np.empty((6, q.shape[1]))
    for s in range(q.shape[0]):
        forward(tables, q[s], residual, jacobian, nothing, nothing, 0.0)
        copy(residual[:3], found[s])


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
