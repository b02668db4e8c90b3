"""A joint whose stiffness depends on the temperature."""

from __future__ import annotations

from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.scales import Scales
from picchio.model.plant import Changes


class ThermalStiffness(Effect):
    """The joint's stiffness changes by `per_kelvin` of itself a kelvin, from the mean on."""

    name = "thermal_stiffness"
    where = "over-time"
    target_kind = "joint"
    parameters = (
        Parameter("per_kelvin", "1/K", lower=-1.0, upper=1.0, meaning="relative change a kelvin"),
    )
    meaning = "the joint softens (or stiffens) when warm"
    mark = "spring"
    takes = "kelvin"

    def structure(self, plant: Changes) -> None:
        """Scale the spring by the temperature."""
        kelvin = plant.conditions.temperature
        if kelvin is not None:
            factor = max(1.0 + self.values["per_kelvin"] * kelvin, 0.01)
            plant.springs[plant.check_joint(self.target)] *= factor

    def without_load(self, conditions: Conditions) -> str | None:
        """Nothing changes where no temperature is given."""
        if conditions.temperature is None:
            return "depends on the temperature, and none is given here"
        return super().without_load(conditions)

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """A tenth over the campaign's range."""
        return [{"per_kelvin": -0.1 / scales.kelvin}] if scales.kelvin > 0.0 else []
