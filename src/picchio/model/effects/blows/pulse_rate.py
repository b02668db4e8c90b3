"""Blows faster or slower than programmed."""

from __future__ import annotations

from picchio.model.blows import Blows
from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, parameter
from picchio.model.effects.evidence import Evidence
from picchio.model.effects.scales import Scales


class PulseRate(Effect):
    """The blows' period is `scale` times the programmed one."""

    name = "pulse_rate"
    where = "blows"
    target_kind = "tool"
    parameters = (
        parameter(
            "scale",
            neutral=1.0,
            lower=0.5,
            upper=2.0,
            log=True,
            meaning="true period over programmed",
        ),
    )
    meaning = "the tool hits faster or slower than programmed"

    @classmethod
    def why_not(cls, evidence: Evidence) -> str:
        """As of any effect; what was recorded is as it came, whatever was programmed."""
        return "the force was recorded in every record" if evidence.recorded else ""

    def blows(self, blows: Blows, conditions: Conditions) -> Blows:
        """Stretch the times of the blows."""
        scale = self.values["scale"]
        period = None if blows.period is None else scale * blows.period
        return blows.change(
            start=scale * blows.start, period=period, interval=scale * blows.interval
        )

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """Slower and faster by little and by more: the phase runs away within a burst."""
        return [{"scale": s} for s in (0.96, 0.985, 0.995, 1.005, 1.015, 1.04)]
