"""A sensor that does not see slow motion."""

from __future__ import annotations

from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.sensors import filtering
from picchio.model.sensing import Sensors


class SensorHighpass(Effect):
    """A high-pass, as of a charge amplifier (first order) or of a logger's own filter."""

    name = "sensor_highpass"
    where = "sensor"
    target_kind = "channel group"
    parameters = (
        Parameter("frequency", "Hz", lower=1e-4, upper=1e4, logarithmic=True, meaning="corner"),
        filtering.ORDER,
        filtering.DIGITAL,
    )
    meaning = "the sensor's electronics take out slow motion"
    tried = filtering.tried_at((0.3, 1.5))
    source = "Oppenheim, Schafer, Discrete-Time Signal Processing, 3rd ed. 2010, sec. 7.2"

    def sense(self, sensors: Sensors, conditions: Conditions) -> None:
        """Change the group's chain."""
        sensors.chain(self.target).highpass = filtering.filter_of(self.values)
