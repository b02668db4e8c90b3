"""What drawn worlds do to a robot: lives, utilisations and torques, one of each a world."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from picchio.core.arrays import FloatArray


class Drawn(NamedTuple):
    """What drawn worlds do to a robot: k joints with shafts, n flexible ones, m worlds.

    Attributes:
        lives: (k, m) rivets of the mix to failure.
        used: (k, m) fatigue utilisation.
        yielding: (k, m) largest stress, gravity and blows together, over the static strength in
            shear; NaN where that is not known.
        peak: (n, m) N m (N), largest magnitude of gravity and blows together.
        geared: (n, m) torque over the reducer's limit that binds; NaN without a reducer.
    """

    lives: FloatArray
    used: FloatArray
    yielding: FloatArray
    peak: FloatArray
    geared: FloatArray

    @classmethod
    def joined(cls, parts: Sequence[Drawn], axis: int = 1) -> Drawn:
        """Several of them as one.

        Args:
            parts: each with the same joints.
            axis: of the worlds.
        """
        return cls(*(np.concatenate(column, axis=axis) for column in zip(*parts, strict=True)))

    @property
    def robots_life(self) -> FloatArray:
        """(m,) of the weakest joint; infinite without a shaft."""
        return np.asarray(self.lives.min(axis=0, initial=np.inf))

    @property
    def robots_use(self) -> FloatArray:
        """(m,) of the most used shaft; without one, of the reducer."""
        if len(self.used):
            return np.asarray(self.used.max(axis=0))
        return np.asarray(np.nanmax(self.geared, axis=0))

    def ends(self, columns: Sequence[int]) -> FloatArray:
        """(n,) the share of the worlds in which each flexible joint ends the robot's life.

        The shortest life; where all are unlimited, the highest utilisation of its parts.

        Args:
            columns: of the k joints among the n flexible ones.
        """
        n, m = self.geared.shape
        lives, used = np.full((n, m), np.inf), np.nan_to_num(self.geared, nan=-1.0)
        lives[list(columns)] = self.lives
        used[list(columns)] = np.maximum(used[list(columns)], self.used)
        endless = np.isinf(lives).all(axis=0)
        first = np.where(endless, used.argmax(axis=0), lives.argmin(axis=0))
        return np.bincount(first, minlength=n) / m

    def holds(self, rivets: float) -> FloatArray:
        """(m,) whether every part holds for a life.

        Args:
            rivets: the life, of the task's mix.
        """
        over = (self.lives < rivets).any(axis=0) | (self.yielding > 1.0).any(axis=0)
        return np.asarray(~(over | (self.geared > 1.0).any(axis=0)))


def interval(values: FloatArray) -> tuple[float, float]:
    """P10 and P90 of drawn values.

    Args:
        values: any shape, infinite ones included.

    Returns:
        the two, each a value that was drawn.
    """
    low, high = np.quantile(values, [0.1, 0.9], method="inverted_cdf")
    return float(low), float(high)
