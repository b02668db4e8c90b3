"""Torque that repeats with the motor's turn."""

from __future__ import annotations

import numpy as np

from picchio.model.effects.effect import Effect, Parameter
from picchio.model.motion import RIPPLE, Motion


class TorqueRipple(Effect):
    """A harmonic of the motor's angle, which also is the wave generator's in a harmonic drive.

    Where the gear ratio is not known it is taken as 1 and orders count per turn of the joint.
    """

    name = "torque_ripple"
    where = "motion"
    target_kind = "joint"
    parameters = (
        Parameter("order", "1", neutral=1.0, lower=1e-3, upper=1e6, shape=True,
                  meaning="cycles a motor turn"),
        Parameter("cosine", "N*m", lower=-1e6, upper=1e6, meaning="amplitude at angle zero"),
        Parameter("sine", "N*m", lower=-1e6, upper=1e6, meaning="a quarter period later"),
    )  # fmt: skip
    linear = ("cosine", "sine")
    meaning = "magnets, slots, bearings or the wave generator pulse once or several times a turn"
    periodic = True
    usual = 12
    source = "Tuttle, Seering, IEEE Trans. Robotics and Automation 12(3), 1996"

    def motion(self, motion: Motion) -> None:
        """Add it to the drive's torque."""
        turns = self.values["order"] * motion.gear_ratio[self.target]
        phase = turns * motion.angle[self.target]
        wave = self.values["cosine"] * np.cos(phase) + self.values["sine"] * np.sin(phase)
        motion.add(RIPPLE, self.target, wave)

    def motion_trials(self, motion: Motion) -> list[dict[str, float]]:
        """None: orders are searched for in the residual (`diagnosis.motion.orders`)."""
        return []
