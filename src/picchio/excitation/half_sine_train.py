"""Half-sine blows: nearer to what a hammer's blow looks like than a rectangle is."""

from __future__ import annotations

from dataclasses import dataclass

from picchio.excitation.excitation import Excitation
from picchio.excitation.piecewise import PiecewiseForce
from picchio.excitation.pulse_train import check_train, half_sine, rectangle


@dataclass(frozen=True)
class HalfSineTrain(Excitation):
    """Half-sine blows: F0 sin(pi t / T_d) for 0 <= t < T_d, once a period.

    Attributes and errors: as `PulseTrain`; `force` is the peak.
    """

    kind = "half_sine_train"
    meaning = "half-sine blows of one peak and width, one a period"

    force: float
    period: float
    width: float
    preload: float = 0.0

    def __post_init__(self) -> None:
        check_train(self.force, self.period, self.width, self.preload)

    def blow(self) -> PiecewiseForce:
        """The half-sine."""
        return half_sine(self.force, self.width)

    def other_blow(self) -> PiecewiseForce:
        """A rectangle of the same peak and width."""
        return rectangle(self.force, self.width)

    def describe(self) -> str:
        """One line for people."""
        return (
            f"half-sine blows of {self.force:g} N peak, {self.width * 1e3:g} ms wide, "
            f"every {self.period * 1e3:g} ms"
        )
