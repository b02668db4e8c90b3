"""The tool hits askew."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from picchio.model.blows import Blows
from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, Parameter


class ForceDirection(Effect):
    """The force is turned by a rotation that is fixed in the tool frame."""

    name = "force_direction"
    where = "blows"
    target_kind = "tool"
    parameters = tuple(
        Parameter(f"r{axis}", "rad", lower=-1.6, upper=1.6, meaning=f"about the tool's {axis}")
        for axis in "xyz"
    )
    meaning = "the tool does not hit along the stated direction"
    exceeds = "direction"
    mark = "turned arrow"
    tried = tuple({f"r{axis}": 0.08} for axis in "xyz")  # rad, about each axis

    def blows(self, blows: Blows, conditions: Conditions) -> Blows:
        """Turn the direction."""
        if blows.tool_rotation is None:
            return blows
        turn = pin.exp3(np.array([self.values[f"r{axis}"] for axis in "xyz"]))
        frame = blows.tool_rotation
        return blows.change(direction=frame @ turn @ frame.T @ blows.direction)
