"""Blows that do not come."""

from __future__ import annotations

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.model.blows import Blows
from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, Latent, Parameter


class MissedHits(Effect):
    """Some blows but a record's first are missing; which, is found with the effect."""

    name = "missed_hits"
    where = "blows"
    target_kind = "tool"
    parameters = (Parameter("fraction", lower=0.0, upper=1.0, meaning="of the blows, missing"),)
    meaning = "the tool misfires now and then"
    latent = Latent(
        "1 for each blow that is missing", spread="fraction", step=0.2, lower=0.0, upper=1.0,
        whole=True,
    )  # fmt: skip
    takes = "bursts"
    tried = ({},)  # none missing: the blows are looked at one by one

    def blows(self, blows: Blows, conditions: Conditions) -> Blows:
        """Weaken (0 to 1) each blow of this record by its own amount."""
        missing = self.drawn(blows, conditions)
        return blows if missing is None else blows.change(height=blows.height * (1.0 - missing))

    def draw(self, rng: np.random.Generator, hits: int) -> FloatArray:
        """A record's first blow is its t = 0, so it is there."""
        values = (rng.random(hits) < self.values["fraction"]).astype(float)
        values[0] = 0.0
        return np.asarray(values)
