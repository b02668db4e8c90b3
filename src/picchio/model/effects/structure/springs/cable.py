"""A dress pack that ties a link to the world."""

from __future__ import annotations

from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.scales import Scales
from picchio.model.effects.structure.springs.yielding import MODAL_SHARE
from picchio.model.plant import Changes


class Cable(Effect):
    """An isotropic spring and damper from a link's origin to the world, slack of force at rest."""

    name = "cable"
    where = "structure"
    target_kind = "link"
    parameters = (
        Parameter("stiffness", "N/m", lower=0.0, upper=1e9, meaning="of the cable"),
        Parameter("damping", "N*s/m", lower=0.0, upper=1e6, meaning="of the cable", share=0.02),
        MODAL_SHARE,
    )
    meaning = "a cable or hose holds the link"
    mark = "hose"

    def structure(self, plant: Changes) -> None:
        """Tie the link."""
        plant.modal_share = self.values["modal_share"]
        plant.add_anchor(self.target, self.values["stiffness"], self.values["damping"])

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """A tenth of the arm's own stiffness there."""
        k = 0.1 * scales.link_stiffness.get(self.target, 1.0 / scales.compliance)
        return [{"stiffness": k}, {"damping": 0.01 * k}]
