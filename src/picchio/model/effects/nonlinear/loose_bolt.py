"""A joint that is softer one way than the other."""

from __future__ import annotations

from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.scales import Scales
from picchio.model.plant import Changes
from picchio.model.system import ElementKind


class LooseBolt(Effect):
    """The spring's stiffness changes by `change` where the deflection from rest is positive."""

    name = "loose_bolt"
    where = "nonlinear"
    target_kind = "joint"
    parameters = (
        Parameter(
            "change", "N*m/rad", lower=-1e9, upper=1e9, meaning="stiffness one way over the other"
        ),
    )
    meaning = "a flange opens one way: bolts are loose, the joint is softer that way"
    mark = "spring"

    def structure(self, plant: Changes) -> None:
        """Add what the spring has more on one side."""
        plant.add_element(self.target, ElementKind.BILINEAR, self.values["change"])

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """A third less one way, or the other."""
        k = 0.3 * scales.stiffness[self.target]
        return [{"change": -k}, {"change": k}]
