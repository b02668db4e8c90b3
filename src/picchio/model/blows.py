"""The blows of one record as a list that effects can change, and the force they make."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from picchio.core.arrays import BoolArray, FloatArray
from picchio.core.errors import InputError
from picchio.excitation.piecewise import PiecewiseForce
from picchio.excitation.trains import Excitation, HalfSineTrain, PulseTrain


@dataclass(frozen=True, eq=False)
class Blows:
    """Blows of one width and shape, one after the other.

    Attributes:
        start: (h,) s.
        height: (h,) N.
        hit: (h,) which blow of the programmed burst each belongs to.
        width: s.
        blend: shape from rectangle (0) to half-sine (1) of the same peak.
        period: s, after which everything repeats (one period's blows are given); None for a
            burst, with silence after it.
        direction: (3,) unit vector, world.
        interval: s, from one programmed blow to the next.
        tool_rotation: (3, 3), the tool frame's axes at rest, world.
        shape: a measured history instead of blows; `height` then scales it.
    """

    start: FloatArray
    height: FloatArray
    hit: FloatArray
    width: float
    blend: float
    period: float | None
    direction: FloatArray
    interval: float
    tool_rotation: FloatArray | None = None
    shape: PiecewiseForce | None = None

    @classmethod
    def of(cls, excitation: Excitation, hits: int | None, direction: FloatArray) -> Blows:
        """The blows as programmed: `hits` of them, or a steady train."""
        count = hits or 1
        shape, blend, width = None, 0.0, 0.0
        if isinstance(excitation, PulseTrain | HalfSineTrain):
            blend = 1.0 if isinstance(excitation, HalfSineTrain) else 0.0
            width, height = excitation.width, excitation.force
        else:
            shape, height = excitation.one_period(), 1.0
        return cls(
            start=excitation.period * np.arange(count),
            height=np.full(count, float(height)),
            hit=np.arange(count, dtype=float),
            width=width,
            blend=blend,
            period=None if hits else excitation.period,
            direction=direction,
            interval=excitation.period,
            shape=shape,
        )

    @property
    def key(self) -> tuple[object, ...]:
        """What makes the force: blows with the same key have the same history."""
        times, heights = self.start.tobytes(), self.height.tobytes()
        return (times, heights, self.width, self.blend, self.period, self.shape)

    @property
    def peak(self) -> float:
        """The largest of the heights, N; 1 where there is none."""
        return float(np.abs(self.height).max(initial=0.0)) or 1.0

    def change(self, **changes: object) -> Blows:
        """The same blows with some attributes replaced."""
        return replace(self, **changes)  # type: ignore[arg-type]

    def keep(self, which: BoolArray) -> Blows:
        """Only some of the blows."""
        return replace(
            self, start=self.start[which], height=self.height[which], hit=self.hit[which]
        )

    def with_echo(self, delay: float, ratio: float) -> Blows:
        """Each blow followed by another, `delay` s after its start, `ratio` as high."""
        return replace(
            self,
            start=np.concatenate([self.start, self.start + delay]),
            height=np.concatenate([self.height, ratio * self.height]),
            hit=np.concatenate([self.hit, self.hit]),
        )

    def force(self) -> PiecewiseForce:
        """F(t): the burst from t = 0 on, endless; or one period of a steady train.

        Raises:
            InputError: a width that is not positive.
        """
        if self.shape is not None:
            return self._measured(self.shape)
        if self.width <= 0.0:
            raise InputError("must be positive", key="width", value=self.width)
        start, height = self.start, self.height
        if self.period is not None:
            # What sticks out of the period at either end comes in at the other.
            start = np.concatenate([start - self.period, start, start + self.period])
            height = np.tile(height, 3)
        end = self.period if self.period is not None else np.inf
        edges = np.concatenate([[0.0], start, start + self.width])
        edges = np.unique(np.round(edges[(edges >= 0.0) & (edges < end)], 12))
        middle = edges + 1e-9
        since = middle[:, None] - start
        on = (since >= 0.0) & (since < self.width)
        omega = np.pi / self.width
        constant = (1.0 - self.blend) * (on * height).sum(axis=1)
        amplitude = np.zeros(edges.size, dtype=np.complex128)
        if self.blend != 0.0:
            phase = np.exp(1j * omega * (edges[:, None] - start))
            amplitude = self.blend * (on * height * -1j * phase).sum(axis=1)
        return PiecewiseForce(
            edges,
            end,
            constant,
            np.zeros_like(constant),
            amplitude,
            np.where(amplitude != 0.0, omega, 0.0),
        )

    def _measured(self, shape: PiecewiseForce) -> PiecewiseForce:
        scaled = [shape.scaled(h) for h in self.height]
        names = ("constant", "slope", "amplitude", "angular_frequency")
        start = np.concatenate([s + part.start for s, part in zip(self.start, scaled, strict=True)])
        pieces = {n: np.concatenate([getattr(part, n) for part in scaled]) for n in names}
        if self.period is not None:
            return PiecewiseForce(start=start, end=self.period, **pieces)
        last = self.start[-1] + shape.end
        return PiecewiseForce(
            start=np.append(start, last),
            end=np.inf,
            **{n: np.append(v, 0.0) for n, v in pieces.items()},
        )
