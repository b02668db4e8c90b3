"""Friction that falls as a joint starts to move."""

from __future__ import annotations

import numpy as np

from picchio.model.effects.effect import Effect, Parameter
from picchio.model.motion import TORQUE, Motion


class StribeckFriction(Effect):
    """Dry friction at low speed over what it is at high speed: torque exp(-(v / velocity)^2)."""

    name = "stribeck_friction"
    where = "motion"
    target_kind = "joint"
    parameters = (
        Parameter("torque", "N*m", lower=0.0, upper=1e6, meaning="what is added near standstill"),
        Parameter("velocity", "rad/s", neutral=0.01, lower=1e-7, upper=1e3, logarithmic=True,
                  meaning="where it has fallen to 37 %"),
    )  # fmt: skip
    linear = ("torque",)
    meaning = "the lubricant's film builds up with speed: friction falls first"
    needs = "coulomb_friction"  # it says how dry friction varies
    usual = 6
    source = "Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994"

    def motion(self, motion: Motion) -> None:
        """Add it to the drive's torque."""
        ratio = motion.velocity[self.target] / self.values["velocity"]
        falling = self.values["torque"] * np.exp(-np.minimum(ratio**2, 700.0))
        motion.add(TORQUE, self.target, falling * motion.direction(self.target))

    def motion_trials(self, motion: Motion) -> list[dict[str, float]]:
        """Velocities from well above standstill up to the record's fastest."""
        fastest = float(np.abs(motion.velocity[self.target]).max())
        lowest = 2.0 * motion.still[self.target]
        if fastest <= 2.0 * lowest:
            return []
        return [{"velocity": v} for v in np.geomspace(lowest, 0.5 * fastest, 8)]
