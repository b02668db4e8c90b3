"""A sensor that does not see slow motion."""

from __future__ import annotations

from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, Parameter
from picchio.model.sensing import Sensors


class SensorHighpass(Effect):
    """A first-order high-pass, as of a charge amplifier."""

    name = "sensor_highpass"
    where = "sensor"
    target_kind = "channel group"
    parameters = (
        Parameter("frequency", "Hz", lower=1e-4, upper=1e4, logarithmic=True, meaning="corner"),
    )
    meaning = "the sensor's electronics take out slow motion"
    tried = ({"frequency": 0.3}, {"frequency": 1.5})

    def sense(self, sensors: Sensors, conditions: Conditions) -> None:
        """Change the group's chain."""
        sensors.chain(self.target).highpass = self.values["frequency"]
