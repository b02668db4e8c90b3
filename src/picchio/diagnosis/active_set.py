"""Least squares within bounds: what would leave its bounds is held there, in turn."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from picchio.core.arrays import FloatArray


def bounded_solution(
    normal: FloatArray,
    right: FloatArray,
    low: FloatArray,
    high: FloatArray,
    solve: Callable[[FloatArray, FloatArray, NDArray[np.intp]], FloatArray],
    slack: float,
) -> FloatArray:
    """The step that leaves least within the bounds (active set).

    Args:
        normal: (k, k) normal equations' matrix.
        right: (k,) their right side.
        low: (k,) lowest step.
        high: (k,) highest step.
        solve: (matrix, right side, which of the k) -> solution, of those that are free.
        slack: how far beyond a bound is still within.

    Returns:
        (k,) the step.
    """
    free = np.ones(right.size, dtype=bool)
    step = np.zeros(right.size)
    for _ in range(right.size + 1):
        index = np.flatnonzero(free)
        if not index.size:
            break
        held = normal[np.ix_(index, np.flatnonzero(~free))] @ step[~free]
        step[index] = solve(normal[np.ix_(index, index)], right[index] - held, index)
        out = free & ((step < low - slack) | (step > high + slack))
        if not out.any():
            break
        step[out] = np.clip(step[out], low[out], high[out])
        free &= ~out
    return step
