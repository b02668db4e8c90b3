"""A sensor that is late."""

from __future__ import annotations

from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.scales import Scales
from picchio.model.sensing import Sensors


class SensorDelay(Effect):
    """The reading at t is the truth at t - delay."""

    name = "sensor_delay"
    where = "sensor"
    target_kind = "channel group"
    among = ("groups", "forces")
    parameters = (Parameter("delay", "s", lower=-0.1, upper=0.1, meaning="late by"),)
    meaning = "the channel is late against the others"

    def sense(self, sensors: Sensors, conditions: Conditions) -> None:
        """Change the group's chain."""
        sensors.chain(self.target).delay += self.values["delay"]

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """One and three samples, at least half a millisecond."""
        step = max(scales.step, 5e-4)
        return [{"delay": step}, {"delay": 3.0 * step}]
