"""One placement of the work, and which of two is better."""

from __future__ import annotations

from dataclasses import dataclass

from picchio.core.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Spot:
    """One placement of the work, and how the robot reaches it.

    Attributes:
        move: (4,) dx, dy, dz in m, and the heading in rad.
        period: s, of the blows; None leaves every operation its own.
        poses: (k, nv) rad or m, of every rivet place.
        damage: largest joint's Miner sum of a rivet of the mix.
        utilisation: largest of all joints and places.
    """

    move: FloatArray
    period: float | None
    poses: FloatArray
    damage: float
    utilisation: float

    def better_than(self, other: Spot | None, by: float = 0.0) -> bool:
        """Whether the life is longer; or, where it is the same, the utilisation lower."""
        if other is None:
            return True
        if self.damage != other.damage:
            return self.damage < other.damage * (1.0 - by)
        return self.utilisation < other.utilisation * (1.0 - by)
