"""Friction that differs between the two directions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from picchio.model.effects.effect import Effect, Parameter
from picchio.model.motion import TORQUE, Motion


class AsymmetricFriction(Effect):
    """Friction is larger one way than the other: half the difference, dry and viscous."""

    name = "asymmetric_friction"
    where = "motion"
    target_kind = "joint"
    parameters = (
        Parameter("torque", "N*m", lower=-1e6, upper=1e6,
                  meaning="dry: half of (forwards less backwards)"),
        Parameter("coefficient", "N*m*s/rad", lower=-1e7, upper=1e7,
                  meaning="viscous: half of (forwards less backwards)"),
    )  # fmt: skip
    linear = ("torque", "coefficient")
    meaning = "gear and seals resist more in one direction than in the other"
    needs = "coulomb_friction"  # it says how dry friction varies
    within: ClassVar[Mapping[str, tuple[str, str]]] = {"torque": ("coulomb_friction", "torque")}
    usual = 4
    source = "Janot, Gautier, Brunot, EMPS benchmark, 2019"

    def motion(self, motion: Motion) -> None:
        """Add it to the drive's torque: the same sign in both directions."""
        velocity = motion.velocity[self.target]
        moves = np.abs(motion.direction(self.target))
        torque = self.values["torque"] + self.values["coefficient"] * np.abs(velocity)
        motion.add(TORQUE, self.target, moves * torque)
