"""Counted load cycles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from picchio.core.arrays import FloatArray, as_floats
from picchio.core.errors import InputError
from picchio.core.shown import Shown

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True, eq=False)
class Cycles(Shown):
    """Load cycles, in the order in which they closed; the residue's last.

    Attributes:
        range: (c,) largest less smallest value of each cycle, in the history's unit.
        mean: (c,) their mean, in the history's unit.
        count: (c,) how often each was counted: 1, or 0.5 for half a cycle.
    """

    PLOTS: ClassVar = {"counted": "visuals.plots.stress:plot_counted_cycles"}
    LACKS: ClassVar = {"show": "cycles have no place in space"}

    range: FloatArray
    mean: FloatArray
    count: FloatArray

    def to_frame(self) -> pandas.DataFrame:
        """A row a cycle."""
        import pandas

        return pandas.DataFrame({"range": self.range, "mean": self.mean, "count": self.count})

    def __post_init__(self) -> None:
        for name in ("range", "mean", "count"):
            array = as_floats(getattr(self, name), f"cycles.{name}").copy()
            if array.ndim != 1 or array.shape != np.shape(self.range):
                raise InputError(
                    "range, mean and count must be 1-D and equally long",
                    key=f"cycles.{name}",
                    value=np.shape(array),
                )
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        if (self.range < 0).any() or (self.count < 0).any():
            raise InputError("range and count must not be negative", key="cycles")

    @property
    def amplitude(self) -> FloatArray:
        """(c,) half the range."""
        return self.range / 2.0

    @property
    def total(self) -> float:
        """The number of cycles."""
        return float(self.count.sum())

    def __len__(self) -> int:
        return len(self.range)

    def __add__(self, other: Cycles) -> Cycles:
        return Cycles.trusted(
            np.concatenate((self.range, other.range)),
            np.concatenate((self.mean, other.mean)),
            np.concatenate((self.count, other.count)),
        )

    def repeated(self, times: float) -> Cycles:
        """The same cycles `times` over: counts are multiplied.

        Args:
            times: how often.
        """
        return Cycles(self.range, self.mean, self.count * float(times))

    def shifted(self, mean: float) -> Cycles:
        """The same cycles about a mean that is higher by `mean` (gravity's share, say).

        Args:
            mean: in the unit of the history.
        """
        return Cycles(self.range, self.mean + float(mean), self.count)

    def scaled(self, factor: float) -> Cycles:
        """The cycles of the history times `factor`; a negative one turns the means over.

        Args:
            factor: of the history.
        """
        return Cycles(self.range * abs(float(factor)), self.mean * float(factor), self.count)

    @classmethod
    def trusted(cls, range: FloatArray, mean: FloatArray, count: FloatArray) -> Cycles:
        """The cycles of arrays that are not shared and need no check: this saves time for millions.

        Args:
            range: (k,) largest less smallest value.
            mean: (k,) of each.
            count: (k,) 1 or 0.5 each.
        """
        new = object.__new__(cls)
        for name, array in (("range", range), ("mean", mean), ("count", count)):
            array.flags.writeable = False
            object.__setattr__(new, name, array)
        return new

    @classmethod
    def none(cls) -> Cycles:
        """No cycles at all."""
        return cls(np.empty(0), np.empty(0), np.empty(0))
