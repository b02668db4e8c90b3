"""A sensor mounted askew."""

from __future__ import annotations

from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, parameter
from picchio.model.effects.evidence import Evidence
from picchio.model.effects.scales import Scales
from picchio.model.rotation import exp3
from picchio.model.sensing import Sensors


class SensorMisalignment(Effect):
    """The sensor is turned in its frame: it reads Exp(r)^T v."""

    name = "sensor_misalignment"
    where = "sensor"
    target_kind = "channel group"
    parameters = tuple(
        parameter(f"r{axis}", "rad", lower=-1.6, upper=1.6, meaning=f"about the frame's {axis}")
        for axis in "xyz"
    )
    meaning = "the sensor is mounted a little askew"

    @classmethod
    def targets(cls, evidence: Evidence) -> list[str]:
        """The groups that read three axes."""
        return [group for group in evidence.groups if group in evidence.vectors]

    def sense(self, sensors: Sensors, conditions: Conditions) -> None:
        """Change the group's chain."""
        chain = sensors.chain(self.target)
        chain.turn = exp3([self.values[f"r{axis}"] for axis in "xyz"]).T @ chain.turn

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """3 degrees about each axis."""
        return [{f"r{axis}": 0.05} for axis in "xyz"]
