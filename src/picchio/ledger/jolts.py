"""Blows in an acceleration: what the ringing from before does not explain."""

from __future__ import annotations

import numpy as np

from picchio.core.arrays import FloatArray

_CELLS = 8  # of a blow's width: shorter swings average out
_MEMORY = 12  # cells that the ringing is told from: six modes; the arm's slow ones count little
_ROUNDS = 6  # until the weights stand still
_ROWS = 20_000  # that the ringing is learned from
_LIKE = 0.3
"""Of the largest blow near by: the ringing is explained to a tenth or better, and the blows of one
tool differ by less than a factor of three."""
_PEAKED = 4.0
"""Kurtosis: 1.5 of a sine, 3 of noise, 2.8 to 3.3 of a turning tool; mostly 8 of blow trains."""
_RINGS = 0.8
"""s: down to a fifth of a blow takes 0.7 at 100 Hz and 0.5 %; what goes on for longer without a
blow is driven, such as by a tool that turns."""


def jolts(
    time: FloatArray, values: FloatArray, threshold: float, width: float, period: float
) -> list[tuple[float, FloatArray, bool]] | None:
    """The blows of a stretch of an acceleration.

    A free decay of any modes is, sample by sample, a fixed sum of samples before it, whatever the
    rate of the samples. So each sample is told from those that are a blow's width and more before
    it; what is left of it is what a blow has done since, and the later swings of a mount are none.
    The sum is fitted to the stretch itself, by weights that leave the blows out.

    Args:
        time: (m,) s, ascending.
        values: (m, k) m/s^2.
        threshold: m/s^2, what a blow exceeds.
        width: s, of a blow.
        period: s, from one blow to the next, about.

    Returns:
        of each blow: s, when it begins; (k,) m/s^2, its largest reading without the ringing from
        before; whether the stretch begins or ends within it. None where nothing stands out: a tool
        that turns has no separate blows.
    """
    from scipy.ndimage import maximum_filter1d

    if time.size < 2:
        return []
    step = max(width / _CELLS, float(np.median(np.diff(time))))
    cells = averaged(time, values, step)
    cells -= np.median(cells, axis=0)
    lag = max(round(width / step), 1) + 1
    memory = int(min(_MEMORY, max(2.0, 0.5 * period / step - 2 * lag)))
    quick = _unexplained(cells, lag, memory, 0.1 * threshold)
    size = np.linalg.norm(quick, axis=1)
    if not size.max() > threshold:
        return []
    each = int(period / step)
    around = maximum_filter1d(np.linalg.norm(cells, axis=1), each + 1)
    moves = around > threshold
    # What tells the ringing has the blow itself in it for a while: then far too much is told.
    size = np.minimum(size, around)
    along = (quick @ quick[int(size.argmax())])[moves]
    if (along**4).mean() < _PEAKED * (along**2).mean() ** 2:
        return None
    near = maximum_filter1d(size, 6 * each + 1)
    over = np.flatnonzero(size > np.maximum(threshold, _LIKE * near))
    found, at = [], 0
    while at < over.size:
        begin = int(over[at])
        end = min(begin + lag, size.size)
        top = begin + int(size[begin:end].argmax())
        cut = begin == 0 or begin + lag > size.size
        found.append((float(time[0] + begin * step), quick[top], cut))
        # Until then what tells the ringing has this blow in it.
        at = int(np.searchsorted(over, begin + 2 * lag + memory))
    return found if moves.sum() * step < (_RINGS + period) * len(found) else None


def averaged(time: FloatArray, values: FloatArray, step: float) -> FloatArray:
    """(n, k) means over cells of `step` s, of straight lines between samples.

    Args:
        time: (m,) s, ascending.
        values: (m, k) any unit.
        step: s.
    """
    edges = time[0] + step * np.arange(max(int((time[-1] - time[0]) / step), 1) + 1)
    areas = 0.5 * (values[1:] + values[:-1]) * np.diff(time)[:, None]
    whole = np.vstack([np.zeros(values.shape[1]), np.cumsum(areas, axis=0)])
    return np.diff([np.interp(edges, time, column) for column in whole.T], axis=1).T / step


def _unexplained(cells: FloatArray, lag: int, memory: int, least: float) -> FloatArray:
    """What `memory` cells that lie `lag` and more before each do not explain; all of the first."""
    left, first = cells.copy(), lag + memory - 1
    if len(cells) < first + 3 * memory:
        return left
    for k, own in enumerate(cells.T):
        past = np.lib.stride_tricks.sliding_window_view(own, memory)[: own.size - first]
        rows = slice(None, None, -(-len(past) // _ROWS))
        some, target = past[rows], own[first:][rows]
        weight = np.ones(len(target))
        for _ in range(_ROUNDS):
            square = (some * weight[:, None]).T @ some + least**2 * np.eye(memory)
            told = np.linalg.solve(square, (some * weight[:, None]).T @ target)
            rest = target - some @ told
            scale = max(1.5 * float(np.median(np.abs(rest))), 0.1 * least)
            weight = 1.0 / (1.0 + (rest / scale) ** 2) ** 2
        left[first:, k] = own[first:] - past @ told
    return left
