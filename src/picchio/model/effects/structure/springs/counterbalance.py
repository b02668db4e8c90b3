"""A weight or gas spring that carries a joint, and is not in the model."""

from __future__ import annotations

import math

import numpy as np

from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.evidence import Evidence
from picchio.model.motion import Motion
from picchio.model.plant import Changes


class Counterbalance(Effect):
    """A torque on the joint's link side, `cosine` cos q + `sine` sin q + `spring` q.

    Its slope is a stiffness beside the joint's spring.
    """

    name = "counterbalance"
    where = "structure"
    target_kind = "joint"
    parameters = (
        Parameter("cosine", "N*m", lower=-1e6, upper=1e6, meaning="torque at angle zero"),
        Parameter("sine", "N*m", lower=-1e6, upper=1e6, meaning="torque a quarter turn on"),
        Parameter("spring", "N*m/rad", lower=-1e6, upper=1e6, meaning="torque over the angle"),
    )
    meaning = "a weight, a spring or a gas cylinder carries part of the load of the joint"
    mark = "spring"
    weighs = True
    usual = 10
    takes = "motion"
    told_by = "slowly through the joint's whole range, once with a known mass at the tool"
    tried = ({"cosine": 500.0}, {"spring": -1e4})

    @classmethod
    def targets(cls, evidence: Evidence) -> list[str]:
        """Of joints that move, those that turn far enough."""
        found = super().targets(evidence)
        return [joint for joint in found if not evidence.motion or joint in evidence.swept]

    def structure(self, plant: Changes) -> None:
        """Add the torque, and its slope as a spring from the link side to the world."""
        values, q = self.values, plant.angle(self.target)
        slope = values["spring"] - values["cosine"] * math.sin(q) + values["sine"] * math.cos(q)
        plant.add_coordinate(plant.check_joint(self.target), -slope, 0.0)

    def motion(self, motion: Motion) -> None:
        """Take the torque off what the gear transmits."""
        q, values = motion.angle[self.target], self.values
        if any(values.values()):
            carried = values["cosine"] * np.cos(q) + values["sine"] * np.sin(q)
            motion.add_body_torque(self.target, -(carried + values["spring"] * q))
