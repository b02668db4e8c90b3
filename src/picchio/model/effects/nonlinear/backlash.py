"""Play in a joint."""

from __future__ import annotations

import math

import numpy as np

from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.scales import Scales
from picchio.model.motion import WINDUP, Motion
from picchio.model.plant import Changes
from picchio.model.system import ElementKind


class Backlash(Effect):
    """A dead zone in the joint's spring; a loaded joint rests at its edge, others at its centre."""

    name = "backlash"
    where = "nonlinear"
    target_kind = "joint"
    parameters = (Parameter("gap", "rad", lower=0.0, upper=0.2, meaning="full width of the play"),)
    meaning = "the gear has play: no torque within the gap"
    told_by = "slowly under load, then fast: a delay grows with speed, a spring does not"
    elastic = True
    usual = 11

    def structure(self, plant: Changes) -> None:
        """Replace the spring's torque by the dead zone's."""
        stiffness, torque = plant.springs[plant.check_joint(self.target)], 0.0
        if abs(load := plant.gravity_torque[self.target]) > 1e-9:
            torque = -load  # what the spring carries, along the deflection
        gap = self.values["gap"]
        rest = torque / stiffness + (math.copysign(0.5 * gap, torque) if torque else 0.0)
        plant.add_element(self.target, ElementKind.BACKLASH, stiffness, gap, rest, torque)

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """A tenth, a half and once the largest deflection."""
        return [{"gap": part * scales.deflection[self.target]} for part in (0.1, 0.4, 1.0)]

    def motion(self, motion: Motion) -> None:
        """The link side lies at the edge of the gap towards which the load pushes it."""
        side = np.sign(motion.body[self.target])
        motion.add(WINDUP, self.target, -0.5 * self.values["gap"] * side)
