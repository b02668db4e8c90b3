"""A mass at the tool that the model does not have."""

from __future__ import annotations

import math

import numpy as np

from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.scales import Scales
from picchio.model.motion import Motion
from picchio.model.plant import Changes
from picchio.robot.flexible_robot import FlexibleRobot


class Payload(Effect):
    """A point mass at the origin of the tool frame, over what the tool is taken to weigh."""

    name = "payload"
    where = "structure"
    target_kind = "tool"
    parameters = (Parameter("mass", "kg", lower=-500.0, upper=5000.0, meaning="added mass"),)
    meaning = "the tool is heavier (or lighter) than stated"
    sidecar = "mass"
    told_by = "once with a known mass at the tool and once without"
    weighs = True
    usual = 1
    mark = "added mass"

    def structure(self, plant: Changes) -> None:
        """Add the mass; the pose is given, so its weight loads the springs but bends nothing."""
        plant.add_mass(self.values["mass"], plant.robot.tool_frame, (0.0, 0.0, 0.0))

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """Two hundredths of what moves; a quarter of that, for a light wrist's fast modes."""
        return [{"mass": share * scales.mass} for share in (0.02, 0.005)]

    def motion(self, motion: Motion) -> None:
        """Add its weight and inertia to every joint's torque."""
        if self.values["mass"] != 0.0:
            motion.add_body(motion.tool, self.values["mass"] * np.eye(10)[0])

    def possible(self, robot: FlexibleRobot) -> dict[str, tuple[float, float]]:
        """No more is taken off than what carries the tool frame weighs."""
        return {"mass": (-robot.rigid.mass_of(robot.tool_frame), math.inf)}
