"""The exponential's phi functions, from which every closed-form response is built."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from picchio.core.arrays import ComplexArray

_SERIES_TERMS = 18
_SERIES_RADIUS = 0.7


def phi1(z: ArrayLike) -> ComplexArray:
    """(exp(z) - 1) / z, equal to 1 at z = 0, without cancellation.

    Args:
        z: complex, any shape.

    Source: Hochbruck and Ostermann, Acta Numerica 19 (2010) 209, eq. 2.10.
    """
    z = np.asarray(z, dtype=np.complex128)
    small = np.abs(z) < 1e-8
    safe = np.where(small, 1.0, z)
    return np.where(small, 1.0 + 0.5 * z, np.expm1(safe) / safe)


def phi2(z: ArrayLike) -> ComplexArray:
    """(exp(z) - 1 - z) / z^2, equal to 1/2 at z = 0, without cancellation."""
    z = np.asarray(z, dtype=np.complex128)
    small = np.abs(z) < _SERIES_RADIUS
    near = np.where(small, z, 0.0)
    series = np.zeros_like(near)
    # Horner on sum z^k / (k + 2)!: 1/2 (1 + z/3 (1 + z/4 (1 + ...)))
    for k in range(_SERIES_TERMS, 2, -1):
        series = (1.0 + series) * near / k
    series = 0.5 * (1.0 + series)
    safe = np.where(small, 1.0, z)
    return np.where(small, series, (phi1(safe) - 1.0) / safe)
