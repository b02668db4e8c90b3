"""The whole robot damped more or less than it is taken to be."""

from __future__ import annotations

from picchio.model.effects.effect import Effect, factor
from picchio.model.plant import Changes


class ModalDamping(Effect):
    """All modal damping ratios are `scale` times those stated."""

    name = "modal_damping"
    where = "structure"
    target_kind = "robot"
    parameters = (factor("scale", 0.02, 50.0, "true damping over stated"),)
    meaning = "all modes are damped more or less than stated"
    tolerance = "damping_ratio"
    sidecar = "damping_ratio"
    source = "Nie et al. 2016, eq. 11: zeta"
    tried = ({"scale": 1.5}, {"scale": 0.67})

    def structure(self, plant: Changes) -> None:
        """Scale all ratios."""
        plant.damping_scale *= self.values["scale"]
