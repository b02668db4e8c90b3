"""A sensor mounted askew."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, Parameter
from picchio.model.sensing import Sensors


class SensorMisalignment(Effect):
    """The sensor is turned in its frame: it reads Exp(r)^T v."""

    name = "sensor_misalignment"
    where = "sensor"
    target_kind = "channel group"
    among = ("vectors",)
    parameters = tuple(
        Parameter(f"r{axis}", "rad", lower=-1.6, upper=1.6, meaning=f"about the frame's {axis}")
        for axis in "xyz"
    )
    meaning = "the sensor is mounted a little askew"
    exceeds = "sensor_angle"
    tried = tuple({f"r{axis}": 0.05} for axis in "xyz")  # rad, about each axis

    def sense(self, sensors: Sensors, conditions: Conditions) -> None:
        """Change the group's chain."""
        chain = sensors.chain(self.target)
        turn = pin.exp3(np.array([self.values[f"r{axis}"] for axis in "xyz"]))
        chain.turn = turn.T @ chain.turn
