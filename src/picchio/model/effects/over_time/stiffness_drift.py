"""A joint that grows softer with the days."""

from __future__ import annotations

from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.scales import Scales
from picchio.model.plant import Changes


class StiffnessDrift(Effect):
    """The joint's stiffness changes by `per_day` of itself a day, from the first record on."""

    name = "stiffness_drift"
    where = "over-time"
    target_kind = "joint"
    parameters = (
        Parameter("per_day", "1/day", lower=-10.0, upper=10.0, meaning="relative change a day"),
    )
    meaning = "the joint wears or loosens while the campaign lasts"
    mark = "spring"
    takes = "days"

    def structure(self, plant: Changes) -> None:
        """Scale the spring by the date."""
        days = plant.conditions.days
        if days is not None:
            factor = max(1.0 + self.values["per_day"] * days, 0.01)
            plant.springs[plant.check_joint(self.target)] *= factor

    def without_load(self, conditions: Conditions) -> str | None:
        """Nothing changes where no date is given."""
        if conditions.days is None:
            return "depends on the date, and none is given here"
        return super().without_load(conditions)

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """A tenth over the whole campaign."""
        return [{"per_day": -0.1 / scales.days}] if scales.days > 0.0 else []
