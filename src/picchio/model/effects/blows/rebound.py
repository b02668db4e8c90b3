"""Every blow is followed by a smaller one."""

from __future__ import annotations

import numpy as np

from picchio.model.blows import Blows
from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.scales import Scales


class Rebound(Effect):
    """A second blow `delay` after the start of each, `ratio` times as high, of the same shape."""

    name = "rebound"
    where = "blows"
    target_kind = "tool"
    parameters = (
        Parameter("ratio", lower=-2.0, upper=2.0, meaning="height over the blow's"),
        Parameter("delay", "s", neutral=0.01, lower=1e-4, upper=1.0, logarithmic=True,
                  meaning="from start to start"),
    )  # fmt: skip
    meaning = "the tool bounces and hits again"
    takes = "programmed"

    def blows(self, blows: Blows, conditions: Conditions) -> Blows:
        """Add the echoes."""
        delay, ratio = self.values["delay"], self.values["ratio"]
        return blows.change(
            start=np.concatenate([blows.start, blows.start + delay]),
            height=np.concatenate([blows.height, ratio * blows.height]),
            hit=np.tile(blows.hit, 2),
        )

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """A fifth as high, at delays all over the period."""
        first, last = scales.width, 0.95 * scales.period
        return [
            {"ratio": 0.2, "delay": first + (last - first) * part}
            for part in (0.05, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95)
        ]
