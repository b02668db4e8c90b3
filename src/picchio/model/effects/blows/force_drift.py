"""Blows that grow stronger or weaker during a burst."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from picchio.model.blows import Blows
from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, Parameter


class ForceDrift(Effect):
    """Blow h (0, 1, ...) of a burst is 1 + per_hit h times as high as programmed."""

    name = "force_drift"
    where = "blows"
    target_kind = "tool"
    parameters = (
        Parameter("per_hit", lower=-0.5, upper=0.5, meaning="relative change from blow to blow"),
    )
    meaning = "the blows fade or build up within a burst (air supply, heating)"
    refused: ClassVar[Mapping[str, str]] = {
        "steady state": "blows that grow or fade within a burst have no steady state"
    }
    takes = "bursts"
    tried = ({"per_hit": 0.02},)

    def blows(self, blows: Blows, conditions: Conditions) -> Blows:
        """Scale each by its place in the burst."""
        return blows.change(height=blows.height * (1.0 + self.values["per_hit"] * blows.hit))
