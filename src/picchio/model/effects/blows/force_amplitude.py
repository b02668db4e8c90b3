"""Blows harder or softer than programmed."""

from __future__ import annotations

from picchio.model.blows import Blows
from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, parameter
from picchio.model.effects.scales import Scales


class ForceAmplitude(Effect):
    """Every blow is `scale` times as high as programmed."""

    name = "force_amplitude"
    where = "blows"
    target_kind = "tool"
    parameters = (
        parameter(
            "scale",
            neutral=1.0,
            lower=0.02,
            upper=50.0,
            log=True,
            meaning="true force over programmed",
        ),
    )
    meaning = "the tool hits harder or softer than programmed"
    tolerance = "force"

    def blows(self, blows: Blows, conditions: Conditions) -> Blows:
        """Scale the heights."""
        return blows.change(height=self.values["scale"] * blows.height)

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """A quarter harder."""
        return [{"scale": 1.25}]
