"""Torque limits of a drive at rest under blows, of a catalogue or estimated."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeVar

from picchio.core.arrays import FloatArray, as_floats

Torque = TypeVar("Torque", float, FloatArray)

# By attribute: the limit's name, and of which torque it is.
_LIMITS = {
    "repeated_peak_torque": ("repeated peak torque", "peak"),
    "momentary_peak_torque": ("momentary peak torque", "peak"),
    "ratcheting_torque": ("ratcheting torque", "peak"),
    "average_torque": ("average torque, held", "held"),
}
_EXCEEDED = {
    "repeated peak torque": "the blows' peak torque exceeds the limit for repeated peaks",
    "momentary peak torque": "the peak torque exceeds even the limit for emergencies",
    "ratcheting torque": "the peak torque exceeds that at which teeth skip",
    "average torque, held": "gravity's torque exceeds the limit for the average torque",
}


@dataclass(frozen=True)
class TorqueLimit:
    """A torque beside the limit that applies to it.

    Attributes:
        name: of the limit, such as "repeated peak torque".
        torque: N m, largest magnitude that acts.
        limit: N m, of the catalogue.
    """

    name: str
    torque: float
    limit: float

    @property
    def share(self) -> float:
        """Torque over limit; above 1 is too much."""
        return self.torque / self.limit

    def to_dict(self) -> dict[str, str | float]:
        """As JSON has it.

        Returns:
            name, torque [N m], limit [N m] and share.
        """
        return vars(self) | {"share": self.share}


@dataclass(frozen=True)
class RatingCheck:
    """Torques of a joint at rest under blows, against its drive's limits.

    Attributes:
        limits: every limit that applies, the one that governs first.
        warnings: what the catalogue does not promise, and which limits are exceeded.
    """

    limits: tuple[TorqueLimit, ...]
    warnings: tuple[str, ...]

    @property
    def governing(self) -> TorqueLimit:
        """The limit that binds."""
        return self.limits[0]


class Ratings:
    """What has torque limits: attributes of a class with this beside it, N m."""

    @property
    def limits(self) -> dict[str, tuple[str, float]]:
        """The limits that bind at standstill and are known: {name: ("peak" or "held", N m)}."""
        known = ((name, which, getattr(self, key, None)) for key, (name, which) in _LIMITS.items())
        return {name: (which, limit) for name, which, limit in known if limit is not None}

    def shares(self, peak: Torque, held: Torque) -> dict[str, Torque]:
        """Torque over limit, by limit.

        Args:
            peak: N m, largest magnitude: a number, or an array (...).
            held: N m, magnitude of gravity's alone, likewise.

        Returns:
            {limit: share}, of the limits that are known.
        """
        torque = {"peak": peak, "held": held}
        return {name: torque[which] / limit for name, (which, limit) in self.limits.items()}

    def check_blows(self, peak_torque: float, holding_torque: float = 0.0) -> RatingCheck:
        """Check a joint at rest under blows.

        Args:
            peak_torque: N m, the largest magnitude of gravity's and the vibration's torque
                together.
            holding_torque: N m, gravity's alone.

        Returns:
            torques beside their limits, and what is beyond its limit.

        Raises:
            InputError: torques that are not finite.
        """
        torque = {
            "peak": abs(float(as_floats(peak_torque, "peak_torque"))),
            "held": abs(float(as_floats(holding_torque, "holding_torque"))),
        }
        found = [TorqueLimit(name, torque[which], limit)
                 for name, (which, limit) in self.limits.items()]  # fmt: skip
        # Of equal shares the first stands first: the sort is stable.
        ranked = sorted(found, key=lambda one: -one.share)
        return RatingCheck(tuple(ranked), tuple(self._warnings(found)))

    def _warnings(self, found: Iterable[TorqueLimit]) -> list[str]:
        """What to say of a check; of the limits that are exceeded."""
        return [f"{_EXCEEDED[one.name]} ({one.share:.2f} times)"
                for one in found if one.share > 1.0]  # fmt: skip
