"""Friction that grows with speed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from picchio.model.effects.effect import Effect, Parameter
from picchio.model.motion import TORQUE, Motion


class ViscousFriction(Effect):
    """A torque against the joint's velocity, in proportion to it."""

    name = "viscous_friction"
    where = "motion"
    target_kind = "joint"
    parameters = (
        Parameter("coefficient", "N*m*s/rad", lower=0.0, upper=1e7, meaning="torque over velocity"),
    )
    linear = ("coefficient",)
    meaning = "lubricant and seals resist in proportion to the speed"
    urdf: ClassVar[Mapping[str, str]] = {"damping": "coefficient"}
    usual = 3
    source = "Swevers, Verdonck, De Schutter, IEEE Control Systems 27(5), 2007"

    def motion(self, motion: Motion) -> None:
        """Add it to the drive's torque."""
        friction = self.values["coefficient"] * motion.velocity[self.target]
        motion.add(TORQUE, self.target, friction)
