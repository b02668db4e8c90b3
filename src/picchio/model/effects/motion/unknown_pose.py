"""Joints that were not recorded and do not stand where they are taken to stand."""

from __future__ import annotations

import numpy as np

from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.evidence import Evidence
from picchio.model.motion import TORQUE, Motion


class UnknownPose(Effect):
    """The arm beyond a joint weighs otherwise than in the pose that its other joints are given."""

    name = "unknown_pose"
    where = "motion"
    target_kind = "joint"
    parameters = (
        Parameter("cosine", "N*m", lower=-1e6, upper=1e6, meaning="more torque at angle zero"),
        Parameter("sine", "N*m", lower=-1e6, upper=1e6, meaning="a quarter turn on"),
    )
    linear = ("cosine", "sine")
    meaning = "joints without an angle stand in another pose than is assumed: state it as `pose`"
    told_by = "with the angles of all joints, or their pose stated"
    usual = 8

    @classmethod
    def targets(cls, evidence: Evidence) -> list[str]:
        """Joints whose load depends on where joints without an angle stand."""
        return list(evidence.unposed)

    def motion(self, motion: Motion) -> None:
        """Add a weight of unknown place and size."""
        q, values = motion.angle[self.target], self.values
        motion.add(TORQUE, self.target, values["cosine"] * np.cos(q) + values["sine"] * np.sin(q))
