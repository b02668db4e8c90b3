"""The whole robot damped more or less than it is taken to be."""

from __future__ import annotations

from picchio.model.effects.effect import Effect, parameter
from picchio.model.effects.scales import Scales
from picchio.model.plant import Changes


class ModalDamping(Effect):
    """All modal damping ratios are `scale` times those stated."""

    name = "modal_damping"
    where = "structure"
    target_kind = "robot"
    parameters = (
        parameter(
            "scale",
            neutral=1.0,
            lower=0.02,
            upper=50.0,
            log=True,
            meaning="true damping over stated",
        ),
    )
    meaning = "all modes are damped more or less than stated"
    tolerance = "damping_ratio"
    source = "Nie et al. 2016, eq. 11: zeta"

    def structure(self, plant: Changes) -> None:
        """Scale all ratios."""
        plant.damping_scale *= self.values["scale"]

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """Half as much again, and two thirds."""
        return [{"scale": 1.5}, {"scale": 0.67}]
