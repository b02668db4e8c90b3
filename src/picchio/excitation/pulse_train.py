"""Rectangular pulses: the paper's blows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from picchio.core.errors import InputError
from picchio.excitation.excitation import Excitation
from picchio.excitation.piecewise import PiecewiseForce


@dataclass(frozen=True)
class PulseTrain(Excitation):
    """Rectangular pulses, the paper's Fig. 4 and eq. 12.

    Attributes:
        force: N, height of the pulse, F0.
        period: s, T.
        width: s, T_d, less than the period.
        preload: N, steady feed force.

    Raises:
        InputError: a number that is not finite, a period or width that is not positive, a
            width that is not less than the period.
    """

    kind = "pulse_train"
    meaning = "rectangular pulses of one height and width, one a period"
    flat = True

    force: float
    period: float
    width: float
    preload: float = 0.0

    def __post_init__(self) -> None:
        check_train(self.force, self.period, self.width, self.preload)

    def blow(self) -> PiecewiseForce:
        """The pulse."""
        return rectangle(self.force, self.width)

    def other_blow(self) -> PiecewiseForce:
        """A half-sine of the same peak and width."""
        return half_sine(self.force, self.width)

    def describe(self) -> str:
        """One line for people."""
        return (
            f"rectangular pulses of {self.force:g} N, {self.width * 1e3:g} ms wide, "
            f"every {self.period * 1e3:g} ms"
        )


def rectangle(force: float, width: float) -> PiecewiseForce:
    """`force` N for `width` s."""
    zero = np.zeros(1)
    return PiecewiseForce(zero, width, np.array([force]), zero, zero, zero)


def half_sine(force: float, width: float) -> PiecewiseForce:
    """F0 sin(pi t / T_d): `force` N at its peak, `width` s long."""
    zero = np.zeros(1)
    # Re(-1j F0 exp(1j w u)) = F0 sin(w u)
    return PiecewiseForce(
        zero, width, zero, zero, np.array([-1j * force]), np.array([np.pi / width])
    )


def check_train(force: float, period: float, width: float, preload: float) -> None:
    """Whether numbers can be those of equal blows, one a period.

    Args:
        force: N.
        period: s.
        width: s.
        preload: N.

    Raises:
        InputError: as `PulseTrain`.
    """
    for key, value in (("force", force), ("period", period), ("width", width)):
        if not np.isfinite(value):
            raise InputError("must be a finite number", key=key, value=value)
    for key, value in (("period", period), ("width", width)):
        if value <= 0.0:
            raise InputError("must be positive", key=key, value=value)
    if not np.isfinite(preload):
        raise InputError("must be a finite number", key="preload", value=preload)
    if width >= period:
        raise InputError(
            f"the blow must be shorter than its period ({period:g} s)", key="width", value=width
        )
