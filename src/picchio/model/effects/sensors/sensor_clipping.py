"""A sensor that ends too early."""

from __future__ import annotations

from picchio.model.conditions import Conditions
from picchio.model.effects.effect import CHANNEL_UNIT, Effect, Parameter
from picchio.model.effects.scales import Scales
from picchio.model.sensing import Sensors


class SensorClipping(Effect):
    """Readings are clipped to +-limit, one limit for the campaign."""

    name = "sensor_clipping"
    where = "sensor"
    target_kind = "channel group"
    parameters = (
        Parameter(
            "limit",
            CHANNEL_UNIT,
            neutral=float("inf"),
            lower=1e-12,
            upper=1e12,
            logarithmic=True,
            meaning="largest reading",
        ),
    )
    meaning = "the reading ends at the sensor's range"

    def sense(self, sensors: Sensors, conditions: Conditions) -> None:
        """Change the group's chain."""
        chain = sensors.chain(self.target)
        chain.limit = min(chain.limit, self.values["limit"])

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """Four fifths and half of the largest reading."""
        largest = scales.reading[self.target][1]
        return [{"limit": 0.8 * largest}, {"limit": 0.5 * largest}]
