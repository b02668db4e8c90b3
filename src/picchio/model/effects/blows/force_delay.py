"""A force sensor that is late, where what it reads drives the model."""

from __future__ import annotations

from picchio.model.blows import Blows
from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.scales import Scales


class ForceDelay(Effect):
    """The force of a record that states no blows acted `delay` before its sensor read it.

    All sensors of the response being early by as much looks the same: one clock has an offset.
    """

    name = "force_delay"
    where = "blows"
    target_kind = "tool"
    parameters = (Parameter("delay", "s", lower=-0.1, upper=0.1, meaning="late by"),)
    meaning = "the force sensor is late against the other sensors"
    takes = "recorded"

    def blows(self, blows: Blows, conditions: Conditions) -> Blows:
        """A recorded force begins earlier; what would lie before t = 0 is lost."""
        if not blows.recorded:
            return blows
        return blows.change(start=blows.start - self.values["delay"])

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """Early and late by one and three samples, at least half a millisecond."""
        step = max(scales.step, 5e-4)
        return [{"delay": k * step} for k in (-3.0, -1.0, 1.0, 3.0)]
