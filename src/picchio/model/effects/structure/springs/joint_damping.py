"""A damper in one joint."""

from __future__ import annotations

from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.scales import Scales
from picchio.model.plant import Changes


class JointDamping(Effect):
    """A viscous damper between a joint's link and motor side, beside the modal damping."""

    name = "joint_damping"
    where = "structure"
    target_kind = "joint"
    parameters = (
        Parameter(
            "damping", "N*m*s/rad", lower=-1e6, upper=1e6, meaning="added damping of the joint"
        ),
    )
    meaning = "this joint alone is damped more (or less) than its share"

    def structure(self, plant: Changes) -> None:
        """Add the damper."""
        plant.add_damper(self.target, self.values["damping"])

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """What adds 0.03 to the damping ratio of the joint on its own inertia."""
        size = (scales.stiffness[self.target] * scales.inertia[self.target]) ** 0.5
        return [{"damping": 0.06 * size}]
