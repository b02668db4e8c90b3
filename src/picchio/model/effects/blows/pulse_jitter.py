"""Blows out of step."""

from __future__ import annotations

import numpy as np

from picchio.model.blows import Blows
from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, parameter
from picchio.model.effects.scales import Scales


class PulseJitter(Effect):
    """Every blow but a record's first comes early or late, by an amount of its own.

    The amounts are found with the effect, record by record; `std` is their spread.
    """

    name = "pulse_jitter"
    where = "blows"
    target_kind = "tool"
    parameters = (parameter("std", "s", lower=0.0, upper=1.0, meaning="spread of the times"),)
    meaning = "the blows come irregularly"
    latent = "shift"

    def blows(self, blows: Blows, conditions: Conditions) -> Blows:
        """Shift each blow of this record by its own amount."""
        shift = self.hidden.get(conditions.record)
        if shift is None:
            return blows
        index = blows.hit.astype(int)
        return blows.change(start=blows.start + np.asarray(shift)[index])

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """The amounts are screened blow by blow, not here."""
        return []
