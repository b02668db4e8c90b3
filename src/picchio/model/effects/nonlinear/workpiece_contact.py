"""The tool is pressed against the workpiece, and can leave it."""

from __future__ import annotations

from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.scales import Scales
from picchio.model.plant import Changes


class WorkpieceContact(Effect):
    """A unilateral spring and damper along the blow, pressed together by a preload at rest."""

    name = "workpiece_contact"
    where = "nonlinear"
    target_kind = "tool"
    parameters = (
        Parameter("stiffness", "N/m", lower=0.0, upper=1e9, meaning="of workpiece and tip"),
        Parameter("preload", "N", neutral=0.0, lower=0.0, upper=1e6, meaning="at rest"),
        Parameter(
            "damping", "N*s/m", lower=0.0, upper=1e6, meaning="of workpiece and tip", share=0.02
        ),
    )
    meaning = "the workpiece holds the tool as long as it touches"
    mark = "plate"

    def structure(self, plant: Changes) -> None:
        """Add the contact."""
        values = self.values
        plant.add_contact(values["stiffness"], values["damping"], values["preload"])

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """As stiff as the arm, lifted early, late or never."""
        k = 0.7 / scales.compliance
        return [{"stiffness": k, "preload": part * k * scales.travel} for part in (0.2, 0.7, 2.0)]
