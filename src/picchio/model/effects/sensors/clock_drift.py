"""A sensor with a clock of its own."""

from __future__ import annotations

from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, Parameter
from picchio.model.sensing import Sensors


class ClockDrift(Effect):
    """The sample stamped t is of the time t (1 + rate)."""

    name = "clock_drift"
    where = "sensor"
    target_kind = "channel group"
    parameters = (Parameter("rate", lower=-0.2, upper=0.2, meaning="relative error of the clock"),)
    meaning = "the channel's clock runs fast or slow"
    # By little and by more: the phase error grows within a record.
    tried = tuple({"rate": r} for r in (-0.006, -0.002, 0.002, 0.006))

    def sense(self, sensors: Sensors, conditions: Conditions) -> None:
        """Change the group's chain."""
        sensors.chain(self.target).clock_rate += self.values["rate"]
