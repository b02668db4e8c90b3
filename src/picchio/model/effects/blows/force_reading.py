"""A force sensor that reads too much or too little, where what it reads drives the model."""

from __future__ import annotations

from picchio.model.blows import Blows
from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, factor


class ForceReading(Effect):
    """The force of a record that states no blows was `scale` times what its sensor read.

    It says nothing of the tool: a study's blows, which are stated, stay as they are.
    """

    name = "force_reading"
    where = "blows"
    target_kind = "tool"
    parameters = (factor("scale", 0.02, 50.0, "true force over what was read"),)
    meaning = "the force sensor reads too much or too little"
    takes = "recorded"
    tolerance = "sensor_gain"
    tried = ({"scale": 1.25},)

    def blows(self, blows: Blows, conditions: Conditions) -> Blows:
        """Scale a recorded force."""
        if not blows.recorded:
            return blows
        return blows.change(height=self.values["scale"] * blows.height)
