"""Points that fill a box evenly, the same every time."""

from __future__ import annotations

import numpy as np

from picchio.core.arrays import FloatArray


def spread_evenly(count: int, dims: int, seed: int = 0) -> FloatArray:
    """(count, dims) points in the unit box, the middle first.

    The additive recurrence of generalised golden ratios: M. Roberts, "The unreasonable
    effectiveness of quasirandom sequences" (2018). Another seed goes on where this one ends.
    """
    ratio = 2.0
    for _ in range(60):
        ratio = (1.0 + ratio) ** (1.0 / (dims + 1))
    steps = ratio ** -np.arange(1.0, dims + 1.0)
    return np.asarray((0.5 + np.outer(np.arange(count) + seed * count, steps)) % 1.0)
