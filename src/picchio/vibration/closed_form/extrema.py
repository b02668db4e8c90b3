"""Turning points of a closed-form response: a grid that misses no cycle, and refined roots."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import ComplexArray, FloatArray, IndexArray
from picchio.excitation.piecewise import PiecewiseForce

_SAMPLES_PER_CYCLE = 16
# A pole's free decay is followed with its own step until it has fallen to exp(-30) = 1e-13.
_DECAYED = 30.0
_MOST_ITERATIONS = 60
# A root known to this share of its interval: the extremum's value is then off by its square.
_PRECISION = 1e-9
_BEND_HALVINGS = 12

Slope = Callable[[IndexArray, FloatArray], tuple[FloatArray, FloatArray]]


@dataclass(frozen=True, eq=False)
class Grid:
    """Sample times, piece by piece, both ends of every piece included.

    Attributes:
        index: (k,) piece of each sample.
        local: (k,) s since the start of its piece.
    """

    index: IndexArray
    local: FloatArray

    @classmethod
    def of(
        cls,
        poles: ComplexArray,
        force: PiecewiseForce,
        horizon: float,
        *,
        density: int = 1,
    ) -> Grid:
        """The samples fine enough for every pole while it lives, and for the force's own waves.

        Args:
            poles: (k,) 1/s.
            force: over one period, or a burst.
            horizon: s, up to which they are wanted.
            density: so many times as many.
        """
        speed = np.abs(poles)
        decay = np.maximum(-poles.real, 1e-300)
        lengths = np.minimum(force.start + force.duration, horizon) - force.start
        locals_: dict[tuple[float, float], FloatArray] = {}
        parts, pieces = [], []
        for i, (length, own) in enumerate(zip(lengths, force.angular_frequency, strict=True)):
            key = (float(length), float(own))
            if key not in locals_:
                locals_[key] = _samples(speed, decay, length, own, density)
            parts.append(locals_[key])
            pieces.append(np.full(locals_[key].size, i))
        return cls(np.concatenate(pieces), np.concatenate(parts))


def _samples(
    speed: FloatArray,
    decay: FloatArray,
    length: float,
    own: float,
    density: int,
) -> FloatArray:
    """Samples of one piece: each pole asks for its own step as long as it lives."""
    rates = np.append(speed, own)
    lives = np.append(np.minimum(_DECAYED / decay, length), length if own > 0 else 0.0)
    order = np.argsort(-rates)
    points = [np.zeros(1)]
    reached = 0.0
    for rate, life in zip(rates[order], lives[order], strict=True):
        if life > reached and rate > 0:
            step = 2.0 * np.pi / rate / (_SAMPLES_PER_CYCLE * density)
            count = int(np.ceil((life - reached) / step))
            points.append(reached + (life - reached) / count * np.arange(1, count + 1))
            reached = life
    samples = np.concatenate(points)
    if samples[-1] < length:
        samples = np.append(samples, length)
    samples[-1] = length
    return samples


def refine_roots(
    grid: Grid, on_grid: tuple[FloatArray, FloatArray], slope: Slope
) -> tuple[IndexArray, FloatArray]:
    """Every zero of a slope between the grid's samples.

    Args:
        grid: the samples.
        on_grid: the slope and its derivative there, both (k,).
        slope: the same anywhere: (piece, local time) -> (slope, its derivative).

    Returns:
        (piece, local time) of the zeros, in the order of time.
    """
    index, u = grid.index, grid.local
    first, second = on_grid
    # A slope that bends back towards zero within an interval may cross it twice: split there.
    left, right = _signs(first, second)
    inward = (
        (index[1:] == index[:-1])
        & (left[:-1] * right[1:] > 0.0)
        & (left[:-1] * second[:-1] < 0.0)
        & (right[1:] * second[1:] > 0.0)
    )
    if inward.any():
        at = np.flatnonzero(inward)
        bend = _bisect(lambda s: slope(index[at], s)[1], u[at], u[at + 1])
        at_bend = slope(index[at], bend)
        index = np.insert(index, at + 1, index[at])
        u = np.insert(u, at + 1, bend)
        first = np.insert(first, at + 1, at_bend[0])
        second = np.insert(second, at + 1, at_bend[1])
        left, right = _signs(first, second)
    same = index[1:] == index[:-1]
    at = np.flatnonzero(same & (left[:-1] * right[1:] < 0.0))
    bracket = (u[at], u[at + 1], first[at], first[at + 1])
    roots = _newton(lambda s: slope(index[at], s), *bracket, sign=left[at])
    # A zero right on a sample; on a piece's start it is the end of the piece before.
    exact = np.append(False, same) & (first == 0.0) & (second != 0.0)
    found_index = np.concatenate([index[at], index[exact]])
    found_u = np.concatenate([roots, u[exact]])
    order = np.lexsort((found_u, found_index))
    return found_index[order], found_u[order]


def _signs(first: FloatArray, second: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The slope's sign just after and just before each sample; a motion from rest starts at 0."""
    zero = first == 0.0
    return np.sign(np.where(zero, second, first)), np.sign(np.where(zero, -second, first))


def _bisect(
    function: Callable[[FloatArray], FloatArray],
    low: FloatArray,
    high: FloatArray,
) -> FloatArray:
    low, high = low.copy(), high.copy()
    sign = np.sign(function(low))
    for _ in range(_BEND_HALVINGS):
        middle = 0.5 * (low + high)
        left = np.sign(function(middle)) == sign
        low, high = np.where(left, middle, low), np.where(left, high, middle)
    return 0.5 * (low + high)


def _newton(
    function: Callable[[FloatArray], tuple[FloatArray, FloatArray]],
    low: FloatArray,
    high: FloatArray,
    at_low: FloatArray,
    at_high: FloatArray,
    *,
    sign: FloatArray,
) -> FloatArray:
    """Newton's method kept inside its bracket by bisection, all roots at once."""
    low, high = low.copy(), high.copy()
    width = high - low
    # The secant's root to begin with: the grid is fine, so the slope is nearly straight.
    x = low + width * at_low / (at_low - at_high)
    x = np.where((x > low) & (x < high), x, 0.5 * (low + high))
    for _ in range(_MOST_ITERATIONS):
        if not x.size:
            break
        value, derivative = function(x)
        left = np.sign(value) == sign
        low, high = np.where(left, x, low), np.where(left, high, x)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = x - value / derivative
        inside = (step >= low) & (step <= high)
        new = np.where(inside, step, 0.5 * (low + high))
        moved = np.abs(new - x)
        x = new
        if (moved <= _PRECISION * width).all():
            break
    return x


def golden_maximum(
    grid: Grid, values: FloatArray, function: Callable[[IndexArray, FloatArray], FloatArray]
) -> tuple[IndexArray, FloatArray]:
    """Where a function is largest, by golden sections beside every sample that may be the top.

    Args:
        grid: the samples.
        values: the function there, (k,), not negative.
        function: the same anywhere.

    Returns:
        (piece, local time) of the candidates.
    """
    top = np.flatnonzero(values >= 0.9 * values.max())
    # A piece has its own ends as samples, so that no bracket leaves it.
    low = np.where((top > 0) & (grid.index[top - 1] == grid.index[top]), top - 1, top)
    after = np.minimum(top + 1, grid.index.size - 1)
    high = np.where(grid.index[after] == grid.index[top], after, top)
    index, a, b = grid.index[top], grid.local[low].copy(), grid.local[high].copy()
    section = (np.sqrt(5.0) - 1.0) / 2.0
    for _ in range(50):
        c, d = b - section * (b - a), a + section * (b - a)
        left = function(index, c) > function(index, d)
        a, b = np.where(left, a, c), np.where(left, d, b)
    return index, 0.5 * (a + b)
