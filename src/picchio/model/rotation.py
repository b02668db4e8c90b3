"""Rotations from rotation vectors."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from picchio.core.arrays import FloatArray


def exp3(vector: ArrayLike) -> FloatArray:
    """The rotation matrix (3, 3) of a rotation vector (3,) rad: Rodrigues' formula."""
    v = np.asarray(vector, dtype=float)
    angle = float(np.linalg.norm(v))
    cross = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    if angle < 1e-8:
        return np.eye(3) + cross + 0.5 * cross @ cross
    return np.asarray(
        np.eye(3) + np.sin(angle) / angle * cross + (1.0 - np.cos(angle)) / angle**2 * cross @ cross
    )
