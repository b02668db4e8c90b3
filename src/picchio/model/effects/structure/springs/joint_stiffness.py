"""A joint softer or stiffer than it is taken to be."""

from __future__ import annotations

from picchio.model.effects.effect import Effect, factor
from picchio.model.effects.evidence import Evidence
from picchio.model.motion import WINDUP, Motion
from picchio.model.plant import Changes


class JointStiffness(Effect):
    """The joint's spring is `scale` times as stiff as stated."""

    name = "joint_stiffness"
    where = "structure"
    target_kind = "joint"
    parameters = (factor("scale", 0.02, 50.0, "true stiffness over stated"),)
    meaning = "the joint's spring is softer or stiffer than stated"
    sidecar = "stiffness"
    told_by = "slowly under load, then fast: a delay grows with speed, a spring does not"
    inverse = ("scale",)
    elastic = True
    usual = 10
    tolerance = "stiffness"
    mark = "spring"
    source = "Nie et al. 2016, eq. 5: K"
    # No further off: there the phases tell little.
    tried = tuple({"scale": scale} for scale in (0.8, 1.25, 0.65, 1.5))

    @classmethod
    def yields_along(cls, target: str) -> str:
        """The joint."""
        return target

    @classmethod
    def targets(cls, evidence: Evidence) -> list[str]:
        """Only joints whose stiffness is stated."""
        return [j for j in super().targets(evidence) if j in evidence.robot.flexible_names]

    def structure(self, plant: Changes) -> None:
        """Scale the spring."""
        plant.springs[plant.check_joint(self.target)] *= self.values["scale"]

    def motion(self, motion: Motion) -> None:
        """Let the link side yield; a motion's baseline takes the drive as rigid."""
        compliance = 1.0 / (self.values["scale"] * motion.stiffness[self.target])
        motion.add(WINDUP, self.target, -compliance * motion.body[self.target])
