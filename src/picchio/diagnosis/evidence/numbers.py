"""Every number that a model has, in three tiers: of the campaign, of a group, of a record."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Numbers:
    """Values, or standard deviations, or steps, of all numbers.

    Attributes:
        shared: (n,) of the whole campaign.
        groups: of each group (pose) of records its own.
        records: of each record its own.
    """

    shared: FloatArray
    groups: tuple[FloatArray, ...]
    records: tuple[FloatArray, ...]

    def __add__(self, other: Numbers) -> Numbers:
        return self._with(other, np.add)

    def __mul__(self, other: Numbers) -> Numbers:
        return self._with(other, np.multiply)

    def __truediv__(self, other: Numbers) -> Numbers:
        return self._with(other, np.divide)

    def scaled(self, factor: float) -> Numbers:
        """All of them times a factor.

        Args:
            factor: of all.
        """
        return Numbers(
            factor * self.shared,
            tuple(factor * own for own in self.groups),
            tuple(factor * own for own in self.records),
        )

    @property
    def square(self) -> float:
        """Sum of squares."""
        parts = (self.shared, *self.groups, *self.records)
        return float(sum(part @ part for part in parts))

    def _with(self, other: Numbers, function: np.ufunc) -> Numbers:
        return Numbers(
            function(self.shared, other.shared),
            tuple(map(function, self.groups, other.groups)),
            tuple(map(function, self.records, other.records)),
        )
