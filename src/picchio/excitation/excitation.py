"""The base of every kind of blow: what it declares, and what follows from it.

To add a kind, write a class in a file of its own in this folder, or anywhere and name it in the
entry-point group `picchio.excitations`.
"""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from picchio.core.errors import InputError
from picchio.core.shown import Shown
from picchio.excitation.piecewise import PiecewiseForce

if TYPE_CHECKING:
    import pandas


class Excitation(Shown, ABC):
    """A blow that repeats, and the steady feed force beside it.

    A kind is a frozen dataclass. The values that a file gives become its arguments.

    Attributes:
        kind: its name in files.
        meaning: one line for people.
        needed: keys that a file must give.
        optional: keys that a file may give.
        programmed: whether numbers alone state it, so that a plan may ask for it. A force that
            was measured is known only afterwards.
        flat: whether a blow stays at its peak for most of its width.
        force: N, peak as stated; None where the kind states none.
        period: s, from one blow to the next.
        width: s, how long a blow lasts as stated; None where the kind states none.
        preload: N, steady feed force along the same direction; it is there before the first
            blow, so that it is a mean and no vibration.
    """

    PLOTS: ClassVar = {
        "force": "visuals.plots.force:plot_force_train",
        "spectrum": "visuals.plots.force:plot_force_spectrum",
    }
    LACKS: ClassVar = {"show": "show the robot they strike"}

    kind: ClassVar[str]
    meaning: ClassVar[str]
    needed: ClassVar[tuple[str, ...]] = ("force", "period", "width")
    optional: ClassVar[tuple[str, ...]] = ("preload",)
    programmed: ClassVar[bool] = True
    flat: ClassVar[bool] = False

    force: float | None
    period: float
    width: float | None
    preload: float

    @classmethod
    def from_table(cls, values: dict[str, Any], folder: Path) -> Self:
        """The excitation that a file states.

        Args:
            values: of the needed keys, and those optional ones that are given.
            folder: that other files are named relative to.

        Raises:
            InputError: a value out of range; its key is the table's.
        """
        return cls(**values)

    def to_frame(self) -> pandas.DataFrame:
        """What states the blows, SI."""
        import pandas

        return pandas.Series(self.to_dict(), name="value").to_frame()

    @abstractmethod
    def blow(self) -> PiecewiseForce:
        """One blow from its start to its end, N; at most a period long."""

    @abstractmethod
    def describe(self) -> str:
        """One line for people."""

    def other_blow(self) -> PiecewiseForce | None:
        """The blow of another shape, of the same peak and width, that it may really have.

        The effect `pulse_shape` blends it in; None where no other shape is meant.
        """
        return None

    @cached_property
    def unit_blows(self) -> tuple[PiecewiseForce, PiecewiseForce | None]:
        """`blow` and `other_blow` over the peak force; as they are where that is 0."""
        peak, other = self.peak_force or 1.0, self.other_blow()
        return self.blow().over(peak), None if other is None else other.over(peak)

    def one_period(self) -> PiecewiseForce:
        """The force over one period: the blow, then silence."""
        return self.blow().padded(self.period)

    def burst(self, hits: int) -> PiecewiseForce:
        """`hits` blows one period apart, then silence for ever.

        Args:
            hits: number of blows.

        Returns:
            the force from t = 0 on.
        """
        return self.one_period().burst(hits)

    @property
    def peak_force(self) -> float:
        """The largest force of a blow, N (the number that `force` in a task states)."""
        return float(self.force or 0.0)

    @property
    def fullness(self) -> float:
        """Mean force of a blow over its peak; 1 where that cannot be said."""
        blow = self.blow()
        return blow.mean() / self.peak_force if self.width and self.peak_force else 1.0

    def scaled(self, force: float = 1.0, width: float = 1.0) -> Self:
        """The same blows, so many times as high and as long.

        Args:
            force: factor.
            width: factor; a blow stays shorter than its period.

        Raises:
            InputError: the kind states no force or no width that could be varied.
        """
        changes: dict[str, Any] = {}
        for key, factor, most in (
            ("force", force, np.inf),
            ("width", width, 0.999 * self.period),
        ):
            stated = getattr(self, key)
            if factor == 1.0:
                continue
            if stated is None:
                raise InputError(f"blows of the kind {self.kind} state no {key} to vary", key=key)
            changes[key] = min(stated * factor, most)
        return dataclasses.replace(self, **changes) if changes else self  # type: ignore[type-var]

    def with_period(self, period: float) -> Self:
        """The same blows at another rate.

        Args:
            period: s.

        Raises:
            InputError: a blow does not fit into the period.
        """
        return dataclasses.replace(self, period=period)  # type: ignore[type-var]

    def to_dict(self) -> dict[str, Any]:
        """For JSON: kind, force, period and width; null where the kind states no such number."""
        return {"kind": self.kind, "force": self.force, "period": self.period, "width": self.width}
