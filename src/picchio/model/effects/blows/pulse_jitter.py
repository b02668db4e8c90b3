"""Blows out of step."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.model.blows import Blows
from picchio.model.conditions import Conditions
from picchio.model.effects.blows.pulse_rate import PulseRate
from picchio.model.effects.effect import Effect, Latent, Parameter

# Blows' times are those of another rate where it leaves at most this share of their variance; of
# fewer blows than these a line is no rule.
_ON_A_LINE = 0.2
_FEWEST = 4


class PulseJitter(Effect):
    """Every blow but a record's first comes early or late, by an amount of its own.

    The amounts are found with the effect, record by record; `std` is their spread.
    """

    name = "pulse_jitter"
    where = "blows"
    target_kind = "tool"
    parameters = (Parameter("std", "s", lower=0.0, upper=1.0, meaning="spread of the times"),)
    meaning = "the blows come irregularly"
    exceeds = "blow_time"
    latent = Latent("shift of each blow, s", spread="std", step=2e-4, times=True)
    takes = "bursts"
    tried = ({},)  # on time: the shifts are looked for blow by blow

    def blows(self, blows: Blows, conditions: Conditions) -> Blows:
        """Shift each blow of this record by its own amount."""
        shift = self.drawn(blows, conditions)
        return blows if shift is None else blows.change(start=blows.start + shift)

    def coarser(self, intervals: Mapping[str, float]) -> tuple[Effect, ...]:
        """Blows at another rate, where each comes later than the last one by about as much.

        All but the first may be late by as much: what a sensor adds passes for it.
        """
        times = np.array(
            [t / intervals[name] for name, own in self.hidden.items() for t in own[1:]]
        )
        hits = np.array([float(h) for own in self.hidden.values() for h in range(1, len(own))])
        if np.unique(hits).size < _FEWEST or not times.any():
            return ()
        slope, first = np.polyfit(hits, times, 1)
        if np.var(times - slope * hits - first) > _ON_A_LINE * np.var(times):
            return ()
        return (PulseRate(self.target).bounded(scale=1.0 + float(slope)),)

    def draw(self, rng: np.random.Generator, hits: int) -> FloatArray:
        """A record's first blow is its t = 0, so it is not shifted."""
        values = self.values["std"] * rng.standard_normal(hits)
        values[0] = 0.0
        return np.asarray(values)
