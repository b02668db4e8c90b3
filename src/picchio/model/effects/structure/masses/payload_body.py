"""A body at the tool that the model does not have."""

from __future__ import annotations

import math

from picchio.core.arrays import FloatArray
from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.scales import Scales
from picchio.model.inertia import body
from picchio.model.motion import Motion
from picchio.model.plant import Changes
from picchio.robot.flexible_robot import FlexibleRobot


class PayloadBody(Effect):
    """A body with its own centre of mass and extent, over what the tool is taken to be.

    Its principal axes are the tool frame's.
    """

    name = "payload_body"
    where = "structure"
    target_kind = "tool"
    parameters = (
        Parameter("mass", "kg", lower=-500.0, upper=5000.0, meaning="added mass"),
        *(Parameter(a, "m", lower=-2.0, upper=2.0, size=0.05, shape=True, spread=0.3,
                    meaning=f"its centre of mass along the tool's {a}") for a in "xyz"),
        *(Parameter(2 * a, "m^2", lower=0.0, upper=1.0, size=0.01, shape=True, spread=0.03,
                    meaning=f"its mean square extent along the tool's {a}") for a in "xyz"),
    )  # fmt: skip
    meaning = "what the tool carries has its centre of mass away from the tool frame"
    told_by = "once with a known mass at the tool and once without"
    weighs = True
    usual = 1
    mark = "added mass"
    refines = "payload"
    over = ("joint_inertia",)
    takes = "motion"

    def _ten(self) -> FloatArray:
        values = self.values
        return body(values["mass"], [values[a] for a in "xyz"], [values[2 * a] for a in "xyz"])

    def structure(self, plant: Changes) -> None:
        """Add the body; the pose is given, so its weight loads the springs but bends nothing."""
        plant.add_body(plant.robot.tool_frame, self._ten())

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """Two hundredths of what moves, 0.1 m off along each axis."""
        return [{"mass": 0.02 * scales.mass, axis: 0.1} for axis in "xyz"]

    def motion(self, motion: Motion) -> None:
        """Add its weight and inertia to every joint's torque."""
        if self.values["mass"] != 0.0:
            motion.add_body(motion.tool, self._ten())

    def possible(self, robot: FlexibleRobot) -> dict[str, tuple[float, float]]:
        """No more is taken off than what carries the tool frame weighs."""
        return {"mass": (-robot.rigid.mass_of(robot.tool_frame), math.inf)}
