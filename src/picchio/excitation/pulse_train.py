"""Blows of one height and width, one a period: rectangular pulses (the paper's) and half-sines."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from picchio.core.errors import InputError
from picchio.excitation.excitation import Excitation
from picchio.excitation.piecewise import PiecewiseForce

# Far beyond any tool on either side; further out the arithmetic overflows.
HIGHEST = 1e9  # N
SHORTEST, LONGEST = 1e-9, 1e6  # s


@dataclass(frozen=True)
class Train(Excitation):
    """Equal blows, one a period: what every such kind states, and how it is checked.

    Attributes:
        words: how one blow is described, with `force` in braces.
        force: N, peak of a pulse or blow, F0.
        period: s, T.
        width: s, T_d, less than the period.
        preload: N, steady feed force.

    Raises:
        InputError: a number that is not finite or absurdly large or small, a period or width that
            is not positive, a width that is not less than the period.
    """

    words: ClassVar[str]

    force: float
    period: float
    width: float
    preload: float = 0.0

    def __post_init__(self) -> None:
        for key in ("force", "period", "width", "preload"):
            value = getattr(self, key)
            if not np.isfinite(value):
                raise InputError("must be a finite number", key=key, value=value)
            if key in ("period", "width"):
                if value <= 0.0:
                    raise InputError("must be positive", key=key, value=value)
                if not SHORTEST <= value <= LONGEST:
                    raise InputError(f"must lie between {SHORTEST:g} and {LONGEST:g} s", key=key,
                                     value=value)  # fmt: skip
            elif abs(value) > HIGHEST:
                raise InputError(f"must be at most {HIGHEST:g} N", key=key, value=value)
        if self.width >= self.period:
            raise InputError(
                f"the blow must be shorter than its period ({self.period:g} s)",
                key="width",
                value=self.width,
            )

    def describe(self) -> str:
        """One line for people."""
        blow = self.words.format(force=f"{self.force:g} N")
        return f"{blow}, {self.width * 1e3:g} ms wide, every {self.period * 1e3:g} ms"


class PulseTrain(Train):
    """Rectangular pulses, the paper's Fig. 4 and eq. 12; attributes and errors as of `Train`."""

    kind = "pulse_train"
    meaning = "rectangular pulses of one height and width, one a period"
    words = "rectangular pulses of {force}"
    flat = True

    def blow(self) -> PiecewiseForce:
        """The pulse."""
        return _rectangle(self)

    def other_blow(self) -> PiecewiseForce:
        """A half-sine of the same peak and width."""
        return _half_sine(self)


USUAL_BLOWS, USUAL_HITS = PulseTrain(force=300.0, period=0.040, width=0.004), 12
"""The blows of a rivet where nobody said: Nie et al. (2016)."""


class HalfSineTrain(Train):
    """Half-sine blows: F0 sin(pi t / T_d) for 0 <= t < T_d; attributes and errors as of `Train`.

    Nearer to what a hammer's blow looks like than a rectangle is.
    """

    kind = "half_sine_train"
    meaning = "half-sine blows of one peak and width, one a period"
    words = "half-sine blows of {force} peak"

    def blow(self) -> PiecewiseForce:
        """The half-sine."""
        return _half_sine(self)

    def other_blow(self) -> PiecewiseForce:
        """A rectangle of the same peak and width."""
        return _rectangle(self)


@dataclass(frozen=True)
class Tap(HalfSineTrain):
    """One blow of a hammer; what is not stated of it is a guess.

    Attributes:
        force: N, peak, about.
        period: s, so long is nothing hit again.
        width: s, about.
    """

    kind = "tap"
    meaning = "one blow of a hammer: its force is measured, or unknown"
    words = "a hammer's blow of about {force} peak"
    needed = ()
    optional = ("force", "period", "width", "preload")

    force: float = 200.0
    period: float = 60.0
    width: float = 0.004


def _rectangle(train: Train) -> PiecewiseForce:
    zero = np.zeros(1)
    return PiecewiseForce(zero, train.width, np.array([train.force]), zero, zero, zero)


def _half_sine(train: Train) -> PiecewiseForce:
    zero = np.zeros(1)
    # Re(-1j F0 exp(1j w u)) = F0 sin(w u)
    amplitude, omega = np.array([-1j * train.force]), np.array([np.pi / train.width])
    return PiecewiseForce(zero, train.width, zero, zero, amplitude, omega)
