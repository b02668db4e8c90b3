"""The base yields."""

from __future__ import annotations

from collections.abc import Sequence

from picchio.core.errors import InputError
from picchio.model.effects.effect import Effect
from picchio.model.effects.scales import Scales
from picchio.model.effects.structure.springs import yielding
from picchio.model.expansion import BASE_AXES
from picchio.model.plant import Changes
from picchio.robot.units import SLIDING


class BaseCompliance(Effect):
    """The whole robot moves along or turns about one world axis through its root link's origin."""

    name = "base_compliance"
    where = "structure"
    target_kind = "axis"
    parameters = (
        yielding.stiffness("of the foundation (N/m along an axis)", upper=1e13),
        yielding.damping("of the foundation (N s/m along an axis)", upper=1e9),
        yielding.MODAL_SHARE,
    )
    meaning = "pedestal, floor or bolts yield under the whole robot"

    @classmethod
    def yields_along(cls, target: str) -> str:
        """The base's coordinate."""
        return f"base.{target}"

    def unit(self, parameter: str) -> str:
        """As of any effect; along an axis per metre, where about it per radian."""
        unit = super().unit(parameter)
        return unit if self.target.startswith("r") else SLIDING.of(unit)

    def structure(self, plant: Changes) -> None:
        """Let the base's coordinate move.

        Raises:
            InputError: no such axis.
        """
        if self.target not in BASE_AXES:
            raise InputError("no such axis", key="target", value=self.target, choices=BASE_AXES)
        plant.modal_share = self.values["modal_share"]
        plant.add_coordinate(
            f"base.{self.target}", self.values["stiffness"], self.values["damping"]
        )

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """A foundation on which the robot alone has 11, 17 or 25 Hz: a resonance is narrow."""
        return self._swinging(scales, (70.0, 105.0, 160.0))

    def early_trials(self, scales: Scales) -> list[dict[str, float]]:
        """From 9 to 90 Hz, a sixth apart."""
        return self._swinging(scales, [57.0 * 1.165**i for i in range(16)])

    def _swinging(self, scales: Scales, rates: Sequence[float]) -> list[dict[str, float]]:
        turns = self.target.startswith("r")
        mass = max(scales.inertia.values()) if turns else scales.mass
        return [{"stiffness": mass * w * w, "damping": 0.08 * mass * w} for w in rates]
