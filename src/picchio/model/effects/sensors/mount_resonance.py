"""A sensor on a soft mount."""

from __future__ import annotations

import math

from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, Parameter
from picchio.model.sensing import Sensors

# Hz: a tool's bracket is soft, wax and a stud are stiffer.
_FREQUENCIES = (50.0, 70.0, 100.0, 140.0, 200.0, 300.0, 450.0)
# Damped by more than 1/sqrt(2) nothing resonates: that is a low-pass filter, an effect of its own.
_MOST = 0.7


class MountResonance(Effect):
    """Each axis passes w^2 / (s^2 + 2 zeta w s + w^2)."""

    name = "mount_resonance"
    where = "sensor"
    target_kind = "channel group"
    among = ("accelerations",)
    parameters = (
        Parameter("frequency", "Hz", neutral=math.inf, lower=1.0, upper=1e5, logarithmic=True,
                  meaning="of the mount"),
        Parameter("damping_ratio", neutral=0.05, lower=1e-3, upper=_MOST, logarithmic=True,
                  meaning="of the mount"),
    )  # fmt: skip
    meaning = "the sensor swings on its magnet, wax or bracket"
    tried = tuple({"frequency": f, "damping_ratio": 0.06} for f in _FREQUENCIES)

    def sense(self, sensors: Sensors, conditions: Conditions) -> None:
        """Change the group's chain."""
        sensors.chain(self.target).mount = (self.values["frequency"], self.values["damping_ratio"])
