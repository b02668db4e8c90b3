"""A sensor that does not see fast motion."""

from __future__ import annotations

from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, Parameter
from picchio.model.sensing import Sensors


class SensorLowpass(Effect):
    """A first-order low-pass."""

    name = "sensor_lowpass"
    where = "sensor"
    target_kind = "channel group"
    parameters = (
        Parameter(
            "frequency",
            "Hz",
            neutral=float("inf"),
            lower=0.1,
            upper=1e5,
            logarithmic=True,
            meaning="corner",
        ),
    )
    meaning = "the sensor or its filter takes out fast motion"
    tried = ({"frequency": 40.0}, {"frequency": 120.0})

    def sense(self, sensors: Sensors, conditions: Conditions) -> None:
        """Change the group's chain."""
        sensors.chain(self.target).lowpass = self.values["frequency"]
