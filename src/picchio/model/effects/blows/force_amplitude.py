"""Blows harder or softer than programmed."""

from __future__ import annotations

from picchio.model.blows import Blows
from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, factor


class ForceAmplitude(Effect):
    """Every blow is `scale` times as high as programmed."""

    name = "force_amplitude"
    where = "blows"
    target_kind = "tool"
    parameters = (factor("scale", 0.02, 50.0, "true force over programmed"),)
    meaning = "the tool hits harder or softer than programmed"
    takes = "programmed"
    tolerance = "force"
    tried = ({"scale": 1.25},)

    def blows(self, blows: Blows, conditions: Conditions) -> Blows:
        """Scale the heights."""
        return blows.change(height=self.values["scale"] * blows.height)
