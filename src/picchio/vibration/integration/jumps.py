"""Jumps between samples: corrected sample values for filters that interpolate linearly.

A filter that takes straight lines between samples (first-order hold) sees a jump as a ramp of one
step, wherever within the step it is: its response then moves in stairs as the jump moves, by
half a step of area. Three sample values around the jump, corrected so that area, first and second
moment of the difference vanish, leave an error of third order in the step. The correction is
continuous in the jump's time.
"""

from __future__ import annotations

import numpy as np

from picchio.core.arrays import FloatArray, IndexArray

_ON = 1e-6


def jump_corrections(
    start: float, step: float, count: int, first: int, times: FloatArray, heights: FloatArray
) -> FloatArray:
    """What to add to samples of a history with jumps, of which one at a sample has its mean there.

    Args:
        start: s, time of the first sample.
        step: s between samples.
        count: of the samples.
        first: the first sample that can be corrected.
        times: (m,) s, of the jumps.
        heights: (m,) of the jumps.

    Returns:
        (count,) in the unit of the heights.
    """
    found = np.zeros(count)
    place = (np.asarray(times) - start) / step
    centre = np.rint(place).astype(np.int64)
    delta = place - centre
    delta = np.where(np.abs(delta) < _ON, 0.0, delta)
    # Moments of the true step less those of the ramp, about the nearest sample, in steps.
    side = np.sign(delta)
    area = 0.5 * side - delta
    first_moment = 1.0 / 6.0 - 0.5 * delta**2
    second_moment = side / 12.0 - delta**3 / 3.0
    even = second_moment - area / 6.0
    left, right = 0.5 * (even - first_moment), 0.5 * (even + first_moment)
    middle = area - even
    # Where nothing stands on the left, two samples keep area and first moment: the first two.
    alone = centre - 1 < first
    beyond = centre < first  # the first is then one step right of where moments are taken
    two_middle = np.where(beyond, 0.0, area - first_moment)
    two_right = np.where(beyond, 2.0 * area - first_moment, first_moment)
    _add(found, centre - 1, heights * np.where(alone, 0.0, left))
    _add(found, centre, heights * np.where(alone, two_middle, middle))
    _add(found, centre + 1, heights * np.where(alone, two_right, right))
    _add(found, centre + 2, heights * np.where(beyond, first_moment - area, 0.0))
    found[:first] = 0.0
    return found


def _add(found: FloatArray, index: IndexArray, values: FloatArray) -> None:
    inside = (index >= 0) & (index < found.size)
    np.add.at(found, index[inside], values[inside])
