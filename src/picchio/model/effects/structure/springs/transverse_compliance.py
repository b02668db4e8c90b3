"""A joint's bearing yields sideways."""

from __future__ import annotations

from collections.abc import Sequence

from picchio.model.effects.effect import Effect
from picchio.model.effects.evidence import Evidence
from picchio.model.effects.scales import Scales
from picchio.model.effects.structure.springs import yielding
from picchio.model.plant import Changes


class TransverseCompliance(Effect):
    """The joint's frame tilts about the two axes perpendicular to its own, isotropically."""

    name = "transverse_compliance"
    where = "structure"
    target_kind = "joint or link"
    parameters = (
        yielding.stiffness("tilting stiffness of the bearing", upper=1e12),
        yielding.damping("tilting damping of the bearing", upper=1e8),
        yielding.MODAL_SHARE,
    )
    meaning = "bearing or link bends across the joint's axis"
    mark = "bending"
    source = "Klimchik et al., Robotics and CIM 30 (2014) 488 (models of more than axial springs)"

    @classmethod
    def targets(cls, evidence: Evidence) -> list[str]:
        """The flexible joints that turn."""
        return [j.name for j in evidence.robot.flexible_joints if j.kind == "revolute"]

    def structure(self, plant: Changes) -> None:
        """Let the two hinges at the joint move."""
        plant.modal_share = self.values["modal_share"]
        joint = plant.check_joint(self.target)
        for i in (1, 2):
            plant.add_coordinate(
                f"hinge.{joint}.{i}", self.values["stiffness"], self.values["damping"]
            )

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """Four and sixteen times as stiff as the joint: what is stiff leaves slowly."""
        return self._stiffer(scales, (4.0, 16.0))

    def early_trials(self, scales: Scales) -> list[dict[str, float]]:
        """From three to a hundred times as stiff as the joint, a sixth in frequency apart."""
        return self._stiffer(scales, [3.0 * 1.35**i for i in range(12)])

    def _stiffer(self, scales: Scales, times: Sequence[float]) -> list[dict[str, float]]:
        k, m = scales.stiffness[self.target], scales.inertia[self.target]
        return [{"stiffness": n * k, "damping": 0.04 * (n * k * m) ** 0.5} for n in times]
