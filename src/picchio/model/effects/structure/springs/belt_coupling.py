"""Two joints that pull at each other."""

from __future__ import annotations

from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.scales import Scales
from picchio.model.effects.structure.springs import yielding
from picchio.model.plant import Changes


class BeltCoupling(Effect):
    """A deflection of one joint loads the joint before it: stiffness off the diagonal."""

    name = "belt_coupling"
    where = "structure"
    target_kind = "joint pair"
    parameters = (
        Parameter(
            "stiffness", "N*m/rad", lower=-1e9, upper=1e9,
            meaning="torque of one joint over the deflection of the other",
        ),
        yielding.MODAL_SHARE,
    )  # fmt: skip
    meaning = "belts or gears of two joints share a path: each one's deflection loads the other"
    mark = "spring"
    source = "Dumas, Caro, Garnier, Furet, Robotics and CIM 27 (2011) 881 (coupled axes)"

    def structure(self, plant: Changes) -> None:
        """Couple the joint with the flexible one before it."""
        plant.modal_share = self.values["modal_share"]
        plant.add_coupling(self.target, self.values["stiffness"])

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """A fifth of the joint's stiffness, and less of it, as the softer of two may be."""
        k = scales.stiffness[self.target]
        return [{"stiffness": share * k} for share in (0.2, 0.06)]
