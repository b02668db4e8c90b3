"""A torque that is reported too large or too small."""

from __future__ import annotations

from picchio.model.effects.effect import Effect, Parameter
from picchio.model.motion import Motion


class TorqueGain(Effect):
    """The drive reports `gain` times its torque: the current's constant or the gear is off."""

    name = "torque_gain"
    where = "motion"
    target_kind = "joint"
    parameters = (
        Parameter("gain", neutral=1.0, lower=0.5, upper=2.0, meaning="reported over true"),
    )
    meaning = "the constant from current to torque is wrong"
    told_by = "once with a known mass at the tool and once without"
    weighs = True
    usual = 9

    def motion(self, motion: Motion) -> None:
        """Scale what the drive reports."""
        motion.scale_torque(self.target, self.values["gain"])
