"""A sensor that does not see fast motion."""

from __future__ import annotations

from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.sensors import filtering
from picchio.model.sensing import Sensors


class SensorLowpass(Effect):
    """A low-pass: the amplifier's, or the logger's own filter."""

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
        filtering.ORDER,
        filtering.DIGITAL,
    )
    meaning = "the sensor or its filter takes out fast motion"
    tried = filtering.tried_at((40.0, 120.0))
    source = "Oppenheim, Schafer, Discrete-Time Signal Processing, 3rd ed. 2010, sec. 7.2"

    def sense(self, sensors: Sensors, conditions: Conditions) -> None:
        """Change the group's chain."""
        sensors.chain(self.target).lowpass = filtering.filter_of(self.values)
