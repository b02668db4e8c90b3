"""A joint's spring that grows stiffer with the deflection."""

from __future__ import annotations

from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.scales import Scales
from picchio.model.plant import Changes
from picchio.model.system import ElementKind


class Hardening(Effect):
    """A torque with the cube of the deflection from the loaded pose, beside the linear one."""

    name = "hardening"
    where = "nonlinear"
    target_kind = "joint"
    parameters = (
        Parameter(
            "cubic", "N*m/rad^3", lower=-1e16, upper=1e16, meaning="torque over deflection cubed"
        ),
    )
    meaning = "the joint's spring is not linear"
    mark = "spring"

    def structure(self, plant: Changes) -> None:
        """Add the cubic torque."""
        plant.add_element(self.target, ElementKind.CUBIC, self.values["cubic"])

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """A tenth more torque at the largest deflection."""
        return [
            {"cubic": 0.1 * scales.stiffness[self.target] / scales.deflection[self.target] ** 2}
        ]
