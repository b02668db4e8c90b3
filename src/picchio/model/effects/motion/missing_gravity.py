"""Torques that were recorded without what holds the arm up."""

from __future__ import annotations

from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.evidence import Evidence
from picchio.model.motion import ROTOR, TORQUE, Motion


class MissingGravity(Effect):
    """The torque that holds the arm against gravity was taken off before it was recorded."""

    name = "missing_gravity"
    where = "motion"
    target_kind = "channel group"
    parameters = (
        Parameter(
            "share",
            lower=0.0,
            upper=2.0,
            spread=0.01,
            centre=1.0,
            meaning="part of gravity's torque that the reading lacks",
        ),
    )
    meaning = "the torque lacks gravity: it was taken off before it was recorded"
    everywhere = True
    usual = 1

    @classmethod
    def targets(cls, evidence: Evidence) -> list[str]:
        """The torques."""
        return [TORQUE] if evidence.driven else []

    def motion(self, motion: Motion) -> None:
        """Take the weight's torque off what every drive reports."""
        for joint, torque in motion.weight().items():
            motion.add(ROTOR, joint, -self.values["share"] * torque)
