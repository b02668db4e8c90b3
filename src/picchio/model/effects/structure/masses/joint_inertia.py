"""Inertia that turns with a joint and is in no link."""

from __future__ import annotations

from picchio.model.effects.effect import Effect, Parameter
from picchio.model.effects.scales import Scales
from picchio.model.motion import ROTOR, Motion
from picchio.model.plant import Changes
from picchio.robot.flexible_robot import FlexibleRobot


class JointInertia(Effect):
    """A constant inertia about the joint's axis that turns with the link side."""

    name = "joint_inertia"
    where = "structure"
    target_kind = "joint"
    parameters = (
        Parameter(
            "inertia",
            "kg*m^2",
            lower=-1e4,
            upper=1e5,
            moving=0.0,
            meaning="added inertia about the joint",
        ),
    )
    linear = ("inertia",)
    meaning = "something unmodelled turns with the joint's link side"
    sidecar = "rotor_inertia"
    motion_meaning = (
        "something unmodelled turns with the joint: most often the motor's rotor, its inertia "
        "times the ratio squared"
    )
    told_by = "once with a known mass at the tool and once without"
    usual = 7

    def structure(self, plant: Changes) -> None:
        """Add it to the mass matrix's diagonal."""
        plant.add_inertia(self.target, self.values["inertia"])

    def trials(self, scales: Scales) -> list[dict[str, float]]:
        """A tenth of what the joint turns."""
        return [{"inertia": 0.1 * scales.inertia[self.target]}]

    def motion(self, motion: Motion) -> None:
        """Add what it takes to accelerate it.

        What is missing while a robot moves is most often the rotor's, times the ratio squared,
        which turns before the gear: it is not taken to wind the gear up.
        """
        torque = self.values["inertia"] * motion.acceleration[self.target]
        motion.add(ROTOR, self.target, torque)

    def possible(self, robot: FlexibleRobot) -> dict[str, tuple[float, float]]:
        """No more than the whole arm has, stretched out, at a joint that turns."""
        return {"inertia": (0.0, robot.largest_inertia(self.target))}
