"""Blows faster or slower than programmed."""

from __future__ import annotations

from picchio.model.blows import Blows
from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, factor


class PulseRate(Effect):
    """The blows' period is `scale` times the programmed one."""

    name = "pulse_rate"
    where = "blows"
    target_kind = "tool"
    parameters = (factor("scale", 0.5, 2.0, "true period over programmed"),)
    meaning = "the tool hits faster or slower than programmed"
    takes = "programmed"
    # By little and by more: the phase error grows within a burst.
    tried = tuple({"scale": s} for s in (0.96, 0.985, 0.995, 1.005, 1.015, 1.04))

    def blows(self, blows: Blows, conditions: Conditions) -> Blows:
        """Stretch the programme; what comes after each blow, or shifts it, stays as it is."""
        scale = self.values["scale"]
        period = None if blows.period is None else scale * blows.period
        start = blows.start + (scale - 1.0) * blows.interval * blows.hit
        return blows.change(start=start, period=period, interval=scale * blows.interval)
