"""A sensor that reads too much or too little."""

from __future__ import annotations

from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, factor
from picchio.model.sensing import Sensors


class SensorGain(Effect):
    """The group reads `gain` times the truth."""

    name = "sensor_gain"
    where = "sensor"
    target_kind = "channel group"
    among = ("groups", "forces")
    parameters = (factor("gain", 0.01, 100.0, "reading over truth"),)
    meaning = "wrong sensitivity or calibration"
    exceeds = "sensor_gain"
    tried = ({"gain": 1.1},)

    def sense(self, sensors: Sensors, conditions: Conditions) -> None:
        """Change the group's chain."""
        sensors.chain(self.target).gain *= self.values["gain"]
