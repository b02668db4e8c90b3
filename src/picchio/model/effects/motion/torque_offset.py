"""A constant torque that no motion explains."""

from __future__ import annotations

import numpy as np

from picchio.model.effects.effect import Effect, Parameter
from picchio.model.motion import TORQUE, Motion


class TorqueOffset(Effect):
    """A constant is added to the torque that the drive reports."""

    name = "torque_offset"
    where = "motion"
    target_kind = "joint"
    parameters = (Parameter("torque", "N*m", lower=-1e6, upper=1e6, meaning="added"),)
    linear = ("torque",)
    meaning = "the current sensor's zero is off, or a constant load pulls at the joint"
    usual = 8

    def motion(self, motion: Motion) -> None:
        """Add it."""
        constant = np.full_like(motion.velocity[self.target], self.values["torque"])
        motion.add(TORQUE, self.target, constant)
