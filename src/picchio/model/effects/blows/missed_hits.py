"""Blows that do not come."""

from __future__ import annotations

import numpy as np

from picchio.model.blows import Blows
from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, parameter
from picchio.model.effects.scales import Scales


class MissedHits(Effect):
    """Some blows but a record's first are missing; which, is found with the effect."""

    name = "missed_hits"
    where = "blows"
    target_kind = "tool"
    parameters = (parameter("fraction", lower=0.0, upper=1.0, meaning="of the blows, missing"),)
    meaning = "the tool misfires now and then"
    latent = "missing"

    def blows(self, blows: Blows, conditions: Conditions) -> Blows:
        """Weaken (0 to 1) each blow of this record by its own amount."""
        missing = self.hidden.get(conditions.record)
        if missing is None:
            return blows
        index = blows.hit.astype(int)
        return blows.change(height=blows.height * (1.0 - np.asarray(missing)[index]))

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """The blows are screened one by one, not here."""
        return []
