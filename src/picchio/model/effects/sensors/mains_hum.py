"""A line of the mains in a sensor."""

from __future__ import annotations

from picchio.model.conditions import Conditions
from picchio.model.effects.effect import CHANNEL_UNIT, Effect, parameter
from picchio.model.effects.scales import Scales
from picchio.model.sensing import Sensors


class MainsHum(Effect):
    """A sine of the mains' frequency, the same in all channels of the group.

    Its phase is another in every record; amplitude and phase are found with the effect.
    """

    name = "mains_hum"
    where = "sensor"
    target_kind = "channel group"
    parameters = (
        parameter(
            "amplitude", CHANNEL_UNIT, lower=0.0, upper=1e12, meaning="in the channel's unit"
        ),
        parameter("frequency", "Hz", neutral=50.0, lower=40.0, upper=70.0, meaning="of the mains"),
    )
    meaning = "the mains leak into the cable"
    latent = "cosine and sine"

    def sense(self, sensors: Sensors, conditions: Conditions) -> None:
        """Add this record's line."""
        line = self.hidden.get(conditions.record)
        if line is not None:
            sensors.chain(self.target).hum.append((self.values["frequency"], line[0], line[1]))

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """The lines are fitted record by record, not here."""
        return []
