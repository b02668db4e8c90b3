"""Blows longer or shorter than programmed."""

from __future__ import annotations

from picchio.model.blows import Blows
from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, parameter
from picchio.model.effects.evidence import Evidence
from picchio.model.effects.scales import Scales


class PulseWidth(Effect):
    """Every blow lasts `scale` times as long as programmed, and is as high.

    A measured force is stretched about the start of each blow.
    """

    name = "pulse_width"
    where = "blows"
    target_kind = "tool"
    parameters = (
        parameter(
            "scale",
            neutral=1.0,
            lower=0.05,
            upper=10.0,
            log=True,
            meaning="true width over programmed",
        ),
    )
    meaning = "the blows last longer or shorter than programmed"

    @classmethod
    def why_not(cls, evidence: Evidence) -> str:
        """As of any effect; what was recorded is as it came, whatever was programmed."""
        return "the force was recorded in every record" if evidence.recorded else ""

    def blows(self, blows: Blows, conditions: Conditions) -> Blows:
        """Scale the width."""
        return blows.change(stretch=self.values["scale"] * blows.stretch)

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """A quarter longer, a quarter shorter."""
        return [{"scale": 1.25}, {"scale": 0.8}]
