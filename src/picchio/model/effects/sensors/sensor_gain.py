"""A sensor that reads too much or too little."""

from __future__ import annotations

from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, parameter
from picchio.model.effects.evidence import Evidence
from picchio.model.effects.scales import Scales
from picchio.model.sensing import Sensors


class SensorGain(Effect):
    """The group reads `gain` times the truth."""

    name = "sensor_gain"
    where = "sensor"
    target_kind = "channel group"
    parameters = (
        parameter(
            "gain", neutral=1.0, lower=0.01, upper=100.0, log=True, meaning="reading over truth"
        ),
    )
    meaning = "wrong sensitivity or calibration"

    @classmethod
    def targets(cls, evidence: Evidence) -> list[str]:
        """Every group, that of the force as well."""
        return [*evidence.groups, *evidence.forces]

    def sense(self, sensors: Sensors, conditions: Conditions) -> None:
        """Change the group's chain."""
        sensors.chain(self.target).gain *= self.values["gain"]

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """A tenth too much."""
        return [{"gain": 1.1}]
