"""Friction that grows with the load on the gear."""

from __future__ import annotations

import numpy as np

from picchio.model.effects.effect import Effect, Parameter
from picchio.model.motion import TORQUE, Motion


class LoadFriction(Effect):
    """Dry friction in proportion to the torque that the gear transmits."""

    name = "load_friction"
    where = "motion"
    target_kind = "joint"
    parameters = (
        Parameter("coefficient", lower=0.0, upper=1.0, meaning="friction over transmitted torque"),
    )
    linear = ("coefficient",)
    meaning = "teeth and bearings rub more under load: the gear's efficiency"
    needs = "coulomb_friction"  # it says how dry friction varies
    weighs = True
    usual = 5
    source = "Hamon, Gautier, Garrec, IROS 2010"

    def motion(self, motion: Motion) -> None:
        """Add it to the drive's torque."""
        load = np.abs(motion.body[self.target])
        friction = self.values["coefficient"] * load * motion.direction(self.target)
        motion.add(TORQUE, self.target, friction)
