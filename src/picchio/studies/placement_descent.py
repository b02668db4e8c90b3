"""The local half of the placement search: a pattern search on the move, the period and the poses.

The largest of several joints' values has kinks, at which gradients stop; here the steps along the
axes are joined by as many in other directions, new each time. Redundant arms try poses shaken
along their self-motion at the same time: each rivet place takes its best on its own.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.studies.placement_search import Search
from picchio.studies.placement_spot import Spot

ROUNDS = 60
_SMALLEST = 2e-4
_SHAKEN = 4


def descend(
    search: Search,
    start: Spot,
    step: FloatArray,
    half: FloatArray,
    periods: tuple[float, float] | None,
    rng: np.random.Generator,
    tell: Callable[[int], object] = lambda done: None,
) -> Spot:
    """The best placement near a start.

    Args:
        search: candidates and scores.
        start: where to begin.
        step: (4,) first steps, m and rad; zero for what stays.
        half: (4,) how far the work may move in all, m and rad.
        periods: s, lowest and highest, or None.
        rng: for the directions beside the axes.
        tell: called with the number of each round, at most `ROUNDS`.

    Returns:
        a spot that is at least as good, free of self-collisions if the start is.
    """
    best = start
    free = np.flatnonzero(step > 0.0)
    shrink = 1.0
    for number in range(ROUNDS):
        if shrink < _SMALLEST:
            break
        tell(number)
        moves = _trials(best.move, step * shrink, half, free, rng)
        seeds = _shaken(search, best, min(shrink, 1.0), rng)
        candidates = search.reach.candidates(moves, seeds)
        search.nearby += len(moves)
        found = search.score(candidates, best.period, best)
        if periods is not None and best.period is not None:
            width = 0.25 * (periods[1] - periods[0]) * shrink
            for period in np.clip([best.period - width, best.period + width], *periods):
                found += search.score(candidates, float(period), best)
        better = [s for s in found if s is not None and s.better_than(best, 1e-7)]
        if better:
            best = min(better, key=lambda s: (s.damage, s.utilisation))
            shrink = min(1.0, shrink * 1.5)
        else:
            shrink *= 0.5
    return best


def _trials(
    centre: FloatArray,
    step: FloatArray,
    half: FloatArray,
    free: FloatArray,
    rng: np.random.Generator,
) -> FloatArray:
    """The centre, a step along every axis both ways, and as many in other directions."""
    steps = [np.zeros(4)]
    for axis in free:
        for sign in (1.0, -1.0):
            one = np.zeros(4)
            one[axis] = sign * step[axis]
            steps.append(one)
    for _ in range(2 * len(free)):
        one = rng.normal(size=4)
        steps.append(one / np.linalg.norm(one[free]) * step)
    return np.unique(np.clip(centre + np.array(steps), -half, half), axis=0)


def _shaken(
    search: Search, best: Spot, shrink: float, rng: np.random.Generator
) -> list[FloatArray]:
    """First guesses around the best poses; the solver brings them back to the tool's place."""
    index = search.reach.chain.index
    own = best.poses[:, index]
    count = _SHAKEN if search.reach.redundant else 0
    noise = rng.normal(size=(count, len(own), len(index))) * max(0.5 * shrink, 1e-3)
    return [np.vstack([own[k : k + 1], own[k] + noise[:, k]]) for k in range(len(own))]
