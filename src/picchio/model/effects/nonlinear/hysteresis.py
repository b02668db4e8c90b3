"""A joint that loses energy in every cycle, however slow."""

from __future__ import annotations

from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.scales import Scales
from picchio.model.plant import Changes
from picchio.model.system import ElementKind


class Hysteresis(Effect):
    """A Bouc-Wen element (n = 1, beta = gamma = 1/2) beside the spring."""

    name = "hysteresis"
    where = "nonlinear"
    target_kind = "joint"
    parameters = (
        Parameter("torque", "N*m", lower=0.0, upper=1e6, meaning="at saturation"),
        Parameter("deflection", "rad", neutral=1e-3, lower=1e-7, upper=0.1, logarithmic=True,
                  meaning="at which it yields"),
    )  # fmt: skip
    meaning = "gear and seals slip a little before they turn"
    source = (
        "Bouc-Wen with n = 1: Ismail, Ikhouane, Rodellar, Arch. Comput. Methods Eng. 16 (2009) 161"
    )

    def structure(self, plant: Changes) -> None:
        """Add the element."""
        torque, deflection = self.values["torque"], self.values["deflection"]
        plant.add_element(self.target, ElementKind.BOUC_WEN, torque, deflection)

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """A twentieth of the spring's torque, at two yield deflections."""
        x = scales.deflection[self.target]
        torque = 0.05 * scales.stiffness[self.target] * x
        return [{"torque": torque, "deflection": part * x} for part in (0.1, 0.4)]
