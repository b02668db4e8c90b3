"""A motor that turns two joints of a wrist at once."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.model.effects.effect import Effect, Parameter
from picchio.model.motion import ROTOR, TORQUE, Motion
from picchio.robot.flexible_robot import FlexibleRobot


class CoupledDrive(Effect):
    """The joint's motor turns with the sum of its own angle and `ratio` times the joint's before.

    Friction acts on that speed and the rotor on that acceleration; both joints feel the torque.
    """

    name = "coupled_drive"
    where = "motion"
    target_kind = "joint pair"
    parameters = (
        Parameter("coefficient", "N*m*s/rad", lower=0.0, upper=1e7, meaning="viscous friction"),
        Parameter("torque", "N*m", lower=0.0, upper=1e6, meaning="dry friction"),
        Parameter("inertia", "kg*m^2", lower=0.0, upper=1e5, meaning="of the rotor"),
        Parameter("ratio", neutral=1.0, lower=-1.0, upper=1.0, shape=True, whole=True,
                  meaning="of the joint's before it in the motor's turn: 1 or -1"),
    )  # fmt: skip
    meaning = "belts or bevel gears: the motor of a wrist's joint turns with the joint before it"
    usual = 7
    over = ("viscous_friction", "coulomb_friction", "joint_inertia")
    beside = ("inertia",)
    everywhere = True
    source = "Gautier, Janot, Vandanjon, IEEE Trans. Control Systems Technology 21(2), 2013 (TX40)"

    def motion(self, motion: Motion) -> None:
        """Add friction and rotor to both joints' torques."""
        before, ratio = motion.before(self.target), self.values["ratio"]
        if before is None:
            return

        def both(x: Mapping[str, FloatArray]) -> FloatArray:
            return x[self.target] + ratio * x[before]

        speed = both(motion.velocity)
        still = motion.still[self.target] + abs(ratio) * motion.still[before]
        direction = np.where(np.abs(speed) <= still, 0.0, np.sign(speed))
        rubs = self.values["coefficient"] * speed + self.values["torque"] * direction
        turns = self.values["inertia"] * both(motion.acceleration)
        for joint, share in ((self.target, 1.0), (before, ratio)):
            motion.add(TORQUE, joint, share * rubs)
            motion.add(ROTOR, joint, share * turns)

    def motion_trials(self, motion: Motion) -> list[dict[str, float]]:
        """Both ways round."""
        return [{"ratio": 1.0}, {"ratio": -1.0}]

    def possible(self, robot: FlexibleRobot) -> dict[str, tuple[float, float]]:
        """No more than the whole arm has, stretched out."""
        return {"inertia": (0.0, robot.largest_inertia(self.target))}
