"""One file from outside picchio: an effect, a kind of channel and an excitation.

`test_additions` installs it, by its entry points alone, where nothing else knows of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from picchio.campaign.channels import ChannelKind
from picchio.campaign.readers import Reading, velocity
from picchio.core.arrays import FloatArray
from picchio.excitation.excitation import Excitation
from picchio.excitation.piecewise import PiecewiseForce
from picchio.model.blows import Blows
from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, Latent, Parameter
from picchio.model.effects.scales import Scales


class SupplyScatter(Effect):
    """The air supply differs from record to record, and all blows of a record with it."""

    name = "supply_scatter"
    where = "blows"
    target_kind = "tool"
    parameters = (Parameter("std", lower=0.0, upper=1.0, meaning="of the force, relative"),)
    meaning = "the air supply's pressure differs from record to record"
    latent = Latent(
        "relative change of a record's force", "std", step=1e-2, lower=-0.9, upper=5.0, count=1
    )

    def blows(self, blows: Blows, conditions: Conditions) -> Blows:
        """Scale every blow of the record by the same factor."""
        drawn = self.hidden.get(conditions.record)
        return blows if drawn is None else blows.change(height=(1.0 + drawn[0]) * blows.height)

    def draw(self, rng: np.random.Generator, hits: int) -> FloatArray:
        """One number a record."""
        return self.values["std"] * rng.standard_normal(1)

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """As stated: what each record adds is fitted."""
        return [{}]


def _turning(reading: Reading) -> FloatArray:
    """(3, samples) rad/s, world axes, to first order in the deflection."""
    frame, _, velocity, _ = reading.frame()
    return np.asarray(frame.jacobian[3:] @ velocity.T)


GYROSCOPE = ChannelKind("gyroscope", "frame", ("rad/s",), True, "rate of turn of the frame",
                        free_offset=True, reader=_turning)  # fmt: skip
VIBROMETER = ChannelKind("vibrometer", "frame", ("m/s",), True, "of the frame, world axes",
                         reader=velocity, derivative=1,
                         plausible=((-5.0, 5.0, "mm/s?"),))  # fmt: skip


@dataclass(frozen=True)
class TriangleTrain(Excitation):
    """Blows that rise and fall in straight lines.

    Attributes:
        force: N, peak.
        period: s.
        rise: s.
        fall: s.
        preload: N.
    """

    kind = "triangle_train"
    meaning = "blows that rise and fall in straight lines"
    needed = ("force", "period", "rise", "fall")
    width = None

    force: float
    period: float
    rise: float
    fall: float
    preload: float = 0.0

    def blow(self) -> PiecewiseForce:
        """Two ramps."""
        zero = np.zeros(2)
        return PiecewiseForce(
            np.array([0.0, self.rise]),
            self.rise + self.fall,
            np.array([0.0, self.force]),
            np.array([self.force / self.rise, -self.force / self.fall]),
            zero,
            zero,
        )

    def describe(self) -> str:
        """One line for people."""
        return f"triangular blows of {self.force:g} N, every {1e3 * self.period:g} ms"
