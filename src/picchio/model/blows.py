"""The blows of one record as a list that effects can change, and the force they make."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.excitation.excitation import Excitation
from picchio.excitation.piecewise import PiecewiseForce, check_hits, superposed


@dataclass(frozen=True, eq=False)
class Blows:
    """Blows of one shape, one after the other.

    Attributes:
        start: (h,) s.
        height: (h,) N.
        hit: (h,) which blow of the programmed burst each belongs to.
        shape: one blow as programmed, of height 1.
        other: a blow of another shape, of the same peak and width; None where none is meant.
        blend: how much of the other shape there is: 0 none, 1 nothing else.
        stretch: how many times as long as programmed a blow lasts.
        width: s, as programmed; None where none is stated.
        period: s, after which everything repeats (one period's blows are given); None for a
            burst, with silence after it.
        direction: (3,) unit vector, world.
        interval: s, from one blow to the next, as programmed; of a recorded force its median.
        tool_rotation: (3, 3), the tool frame's axes at rest, world.
        recorded: whether the force was recorded together with the response: then its one
            "blow" is the whole record.
    """

    start: FloatArray
    height: FloatArray
    hit: FloatArray
    shape: PiecewiseForce
    other: PiecewiseForce | None
    width: float | None
    period: float | None
    direction: FloatArray
    interval: float
    blend: float = 0.0
    stretch: float = 1.0
    tool_rotation: FloatArray | None = None
    recorded: bool = False

    @classmethod
    def of(
        cls,
        excitation: Excitation,
        hits: int | None,
        direction: FloatArray,
        recorded: bool = False,
    ) -> Blows:
        """The blows as programmed: `hits` of them, or a steady train.

        Args:
            excitation: the tool's blows.
            hits: of a burst; None for a steady train.
            direction: (3,) unit vector, world axes.
            recorded: whether the excitation is what was recorded.

        Raises:
            InputError: hits below 1, or more than anybody means.
        """
        if hits is not None:
            check_hits(hits)
        count = hits or 1
        height = excitation.peak_force or 1.0
        shape, other = excitation.unit_blows
        between = np.diff(shape.onsets) if recorded else np.zeros(0)
        return cls(
            start=excitation.period * np.arange(count),
            height=np.full(count, float(height)),
            hit=np.arange(count, dtype=float),
            shape=shape,
            other=other,
            width=excitation.width,
            period=None if hits else excitation.period,
            direction=direction,
            interval=float(np.median(between)) if between.size else excitation.period,
            recorded=recorded,
        )

    @property
    def key(self) -> tuple[object, ...]:
        """What makes the force: blows with the same key have the same history."""
        times, heights = self.start.tobytes(), self.height.tobytes()
        other = self.other.key if self.other is not None and self.blend else None
        return (times, heights, self.stretch, self.blend, self.period, self.shape.key, other)

    @property
    def onsets(self) -> FloatArray:
        """(k,) s, when a blow begins, or a recorded force leaves zero."""
        return np.unique(self.start[:, None] + self.shape.onsets if self.recorded else self.start)

    @property
    def peak(self) -> float:
        """The largest of the heights, N; 1 where there is none."""
        return float(np.abs(self.height).max(initial=0.0)) or 1.0

    def change(self, **changes: object) -> Blows:
        """The same blows with some attributes replaced.

        Args:
            changes: attribute = value.
        """
        return replace(self, **changes)  # type: ignore[arg-type]

    @property
    def parts(self) -> list[tuple[FloatArray, PiecewiseForce]]:
        """What every blow consists of: (h,) N, and what it is times, from the blow's start on.

        Raises:
            InputError: a stretch that is not positive.
        """
        if self.stretch <= 0.0:
            raise InputError("must be positive", key="width", value=self.stretch)
        parts = [((1.0 - self.blend) * self.height, self.shape.stretched(self.stretch))]
        if self.blend and self.other is not None:
            parts.append((self.blend * self.height, self.other.stretched(self.stretch)))
        return parts

    def force(self) -> PiecewiseForce:
        """The force over time: of a burst from t = 0 on, endless; or one period of a steady train.

        Raises:
            InputError: a stretch that is not positive.
        """
        if self.period is None:
            return superposed(self.start, self.parts)
        # What sticks out of the period at either end comes in at the other.
        before = max(int(np.ceil(self.parts[0][1].end / self.period)), 1)
        shifts = self.period * np.arange(-before, 2)
        start = (shifts[:, None] + self.start).ravel()
        parts = [(np.tile(height, shifts.size), shape) for height, shape in self.parts]
        return superposed(start, parts, self.period)
