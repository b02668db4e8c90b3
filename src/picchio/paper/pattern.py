"""The rivet pattern of Fig. 12, as assumed: a panel that faces forward, riveted row by row."""

from __future__ import annotations

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.paper.assumptions import Assumptions


def rivet_points(given: Assumptions) -> FloatArray:
    """Rivets (k, 3) in m in the order of the path: there and back, from the bottom row up."""
    across = (np.arange(given.columns) - (given.columns - 1) / 2.0) * given.pitch
    up = (np.arange(given.rows) - (given.rows - 1) / 2.0) * given.pitch
    points = [
        (given.panel_x, given.panel_y + (a if row % 2 == 0 else -a), given.panel_z + b)
        for row, b in enumerate(up)
        for a in across
    ]
    return np.array(points)
