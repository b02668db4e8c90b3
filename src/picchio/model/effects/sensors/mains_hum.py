"""A line of the mains in a sensor."""

from __future__ import annotations

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.model.conditions import Conditions
from picchio.model.effects.effect import CHANNEL_UNIT, Effect, Latent, Parameter
from picchio.model.sensing import Sensors


class MainsHum(Effect):
    """A sine of the mains' frequency, the same in all channels of the group.

    Its phase is another in every record; amplitude and phase are found with the effect.
    """

    name = "mains_hum"
    where = "sensor"
    target_kind = "channel group"
    parameters = (
        Parameter(
            "amplitude", CHANNEL_UNIT, lower=0.0, upper=1e12, meaning="in the channel's unit"
        ),
        Parameter("frequency", "Hz", neutral=50.0, lower=40.0, upper=70.0, meaning="of the mains"),
    )
    meaning = "the mains leak into the cable"
    latent = Latent(
        "cosine and sine of the line, in the channel's unit", spread="amplitude", count=2,
        linear=True,
    )  # fmt: skip
    # The amplitudes are solved for in every record.
    tried = ({"frequency": 50.0}, {"frequency": 60.0})

    def sense(self, sensors: Sensors, conditions: Conditions) -> None:
        """Add this record's line."""
        line = self.hidden.get(conditions.record)
        if line is not None:
            sensors.chain(self.target).hum.append((self.values["frequency"], line[0], line[1]))

    def draw(self, rng: np.random.Generator, hits: int) -> FloatArray:
        """A line of any phase."""
        phase = rng.uniform(0.0, 2.0 * np.pi)
        return self.values["amplitude"] * np.array([np.cos(phase), np.sin(phase)])

    def take_out(self, rows: FloatArray, time: FloatArray) -> tuple[FloatArray, tuple[float, ...]]:
        """The best line, the same in all channels, is taken out."""
        phase = 2.0 * np.pi * self.values["frequency"] * time
        basis = np.stack([np.cos(phase), np.sin(phase)])
        found = np.linalg.lstsq(basis.T, np.mean(rows, axis=0), rcond=None)[0]
        return rows - found @ basis, (float(found[0]), float(found[1]))
