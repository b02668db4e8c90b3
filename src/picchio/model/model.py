"""The model: a robot, and what it is taken to do under the tool."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.model.linear_system import LinearSystem, modal_damping_matrix

if TYPE_CHECKING:
    from picchio.robot import FlexibleRobot, RobotState


@dataclass(frozen=True, eq=False)
class Model:
    """A robot as a vibrating system.

    Attributes:
        robot: geometry, masses and springs.
        gravity_stiffness: whether the springs' stiffness is joined by gravity's, dg/dq: about
            the loaded equilibrium the stiffness is K + dg/dq. Small for life (below 1 % on
            the 3-DoF arm), decisive when a simulation is held against a measurement.
        gravity_balanced: whether something beside the drives (a spring, a cylinder, a second
            arm) carries all of gravity, so that it leaves no torque in shaft and reducer. A
            balancer that is known belongs into the sidecar instead.
    """

    robot: FlexibleRobot
    gravity_stiffness: bool = False
    gravity_balanced: bool = False

    def holding_torque(self, state: RobotState) -> FloatArray:
        """Torque (n,) that the joints hold against gravity at a state, N m (N)."""
        return (
            np.zeros_like(state.gravity_torque) if self.gravity_balanced else state.gravity_torque
        )

    def linear_system(self, pose: FloatArray) -> LinearSystem:
        """The linear equations of motion at a pose.

        Args:
            pose: (nv,) rad or m.

        Raises:
            InputError: wrong length, a singular mass matrix.
        """
        state = self.robot.state(pose)
        springs = state.stiffness
        damping = modal_damping_matrix(state.mass_matrix, springs, self.robot.damping_ratio)
        stiffness = np.diag(springs)
        if self.gravity_stiffness:
            gravity = self.robot.gravity_stiffness(pose)
            # At a pose that no static torque but the springs' holds, dg/dq is symmetric:
            # it is the Hessian of the potential energy. Rounding is taken out.
            stiffness = stiffness + 0.5 * (gravity + gravity.T)
        names = self.robot.flexible_names
        return LinearSystem(
            state.mass_matrix, damping, stiffness, state.jacobian.T, np.eye(len(names)), names
        )
