"""Blows longer or shorter than programmed."""

from __future__ import annotations

from picchio.model.blows import Blows
from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, factor


class PulseWidth(Effect):
    """Every blow lasts `scale` times as long as programmed, and is as high.

    A measured force is stretched about the start of each blow.
    """

    name = "pulse_width"
    where = "blows"
    target_kind = "tool"
    parameters = (factor("scale", 0.05, 10.0, "true width over programmed"),)
    meaning = "the blows last longer or shorter than programmed"
    takes = "programmed"
    tried = ({"scale": 1.25}, {"scale": 0.8})

    def blows(self, blows: Blows, conditions: Conditions) -> Blows:
        """Scale the width."""
        return blows.change(stretch=self.values["scale"] * blows.stretch)
