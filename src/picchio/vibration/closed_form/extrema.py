"""Turning points of a closed-form response: a grid that misses no cycle, and refined roots."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import ComplexArray, FloatArray, IndexArray
from picchio.core.errors import InputError
from picchio.excitation.piecewise import PiecewiseForce

_SAMPLES_PER_CYCLE = 16
# A pole's free decay is followed with its own step until it has fallen to exp(-30) = 1e-13.
_DECAYED = 30.0
_MOST_ITERATIONS = 60
# A root known to this share of its interval: the extremum's value is then off by its square.
_PRECISION = 1e-9
_BEND_HALVINGS = 12
# Samples times poles of one response: some minutes. What needs more is a slip in a number.
MOST_VALUES = 1_000_000_000

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

        Raises:
            InputError: as `blocks`.
        """
        blocks = list(cls.blocks(poles, force, horizon, density=density, most=MOST_VALUES))
        return cls(*(np.concatenate(p) for p in zip(*(b.parts for b in blocks), strict=True)))

    @property
    def parts(self) -> tuple[IndexArray, FloatArray]:
        """Pieces and local times."""
        return self.index, self.local

    @classmethod
    def blocks(
        cls,
        poles: ComplexArray,
        force: PiecewiseForce,
        horizon: float,
        *,
        density: int = 1,
        most: int,
    ) -> Iterator[Grid]:
        """The same samples, some at a time, so that a long burst does not fill the memory.

        Args:
            poles: as in `of`.
            force: as in `of`.
            horizon: as in `of`.
            density: as in `of`.
            most: samples at a time. A piece with more is cut at a sample, which both parts have.

        Raises:
            InputError: more samples than can be computed in reasonable time.
        """
        speed = np.abs(poles)
        decay = np.maximum(-poles.real, 1e-300)
        lengths = np.minimum(force.start + force.duration, horizon) - force.start
        keys = list(zip(lengths.tolist(), force.angular_frequency.tolist(), strict=True))
        plans = {key: _stretches(speed, decay, *key, density) for key in dict.fromkeys(keys)}
        sizes = {key: 1 + sum(count for _, count in plan) for key, plan in plans.items()}
        _check_size(poles, horizon, sum(sizes[key] for key in keys), sizes[keys[-1]])
        locals_ = {key: _samples(plan, key[0]) for key, plan in plans.items()}
        held: list[tuple[int, FloatArray]] = []
        count = 0
        for i, key in enumerate(keys):
            for first in range(0, max(locals_[key].size - 1, 1), most):
                part = locals_[key][first : first + most + 1]
                if held and (first or count + part.size > most):
                    yield cls._joined(held)
                    held, count = [], 0
                held.append((i, part))
                count += part.size
        yield cls._joined(held)

    @classmethod
    def _joined(cls, held: list[tuple[int, FloatArray]]) -> Grid:
        pieces = np.repeat([i for i, _ in held], [part.size for _, part in held])
        return cls(pieces, np.concatenate([part for _, part in held]))


def _check_size(poles: ComplexArray, horizon: float, samples: int, in_last: int) -> None:
    """Refuse what would take hours; the key is what most of the samples come from."""
    if samples * poles.size <= MOST_VALUES:
        return
    ratio = float((-poles.real / np.abs(poles)).min())
    rings = 2 * in_last > samples
    raise InputError(
        f"the response lasts {horizon:.4g} s and has {poles.size} modes of up to "
        f"{np.abs(poles).max() / (2.0 * np.pi):.4g} Hz: {float(samples) * poles.size:.2g} values, "
        f"where {MOST_VALUES:.0e} are computed at most",
        key="damping_ratio" if rings else "hits",
        value=ratio if rings else None,
        hint="give more damping" if rings else "give fewer hits, or a shorter period",
    )


def _stretches(
    speed: FloatArray, decay: FloatArray, length: float, own: float, density: int
) -> list[tuple[float, int]]:
    """Where one piece's samples change their step, s, and how many there are up to there.

    Each pole asks for its own step as long as it lives.
    """
    rates = np.append(speed, own)
    lives = np.append(np.minimum(_DECAYED / decay, length), length if own > 0 else 0.0)
    order = np.argsort(-rates)
    plan: list[tuple[float, int]] = []
    reached = 0.0
    for rate, life in zip(rates[order].tolist(), lives[order].tolist(), strict=True):
        if life > reached and rate > 0:
            step = 2.0 * np.pi / rate / (_SAMPLES_PER_CYCLE * density)
            plan.append((life, int(np.ceil((life - reached) / step))))
            reached = life
    return plan


def _samples(plan: list[tuple[float, int]], length: float) -> FloatArray:
    """The samples of one piece, both ends included."""
    points: list[FloatArray] = [np.zeros(1)]
    reached = 0.0
    for life, count in plan:
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
    low: FloatArray, high: FloatArray, function: Callable[[FloatArray], FloatArray]
) -> FloatArray:
    """Where a function is largest within intervals, by golden sections in all of them at once.

    Args:
        low: (k,) where each interval begins.
        high: (k,) where it ends.
        function: of (k,) arguments, one in each interval.

    Returns:
        (k,) the arguments.
    """
    a, b = low.copy(), high.copy()
    section = (np.sqrt(5.0) - 1.0) / 2.0
    for _ in range(50):
        c, d = b - section * (b - a), a + section * (b - a)
        left = function(c) > function(d)
        a, b = np.where(left, a, c), np.where(left, d, b)
    return 0.5 * (a + b)
