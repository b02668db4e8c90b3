"""The pose that goes with a dragged tool: near to where the arm stands, within its limits."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from picchio.robot.ik.chain import tool_chain
from picchio.robot.ik.inverse_kinematics import LEAST_JOINTS_FOR_AXIS, Array
from picchio.robot.ik.kernel import descend

if TYPE_CHECKING:
    from picchio.robot.flexible_robot import FlexibleRobot

_STEPS = 60


class Follower:
    """Moves an arm after a point by damped least squares from the pose that it has.

    Levenberg-Marquardt with the joints' limits, as the search for all branches
    (`picchio.robot.ik.kernel`), but from one start: the arm does not jump to another branch.

    Args:
        robot: the robot; joints that do not move the tool stand.
    """

    def __init__(self, robot: FlexibleRobot) -> None:
        self._robot, self._chain = robot, tool_chain(robot)
        self._tables = self._chain.tables

    @property
    def aims(self) -> bool:
        """Whether the arm has joints enough to keep the tool's direction."""
        return len(self._chain.index) >= LEAST_JOINTS_FOR_AXIS

    def follow(
        self, pose: Array, point: ArrayLike, axis: ArrayLike | None = None
    ) -> tuple[Array, float]:
        """The pose that brings the tool to a point, or as near as it gets from here.

        Args:
            pose: (nv,) rad or m, where the arm stands.
            point: (3,) m, world.
            axis: (3,) unit, world, along which the tool shall go on pointing; None leaves it free,
                and so does an arm of fewer than five joints.

        Returns:
            the pose (nv,), and how far from the point the tool is then, m.
        """
        chain, target = self._chain, np.asarray(point, dtype=float)
        if not len(chain.index):
            return pose, float(np.linalg.norm(self._robot.tool_position(pose) - target))
        # Limits as writable copies: the kernel would be compiled again for read-only ones.
        lower, upper = chain.lower.copy(), chain.upper.copy()
        wanted, weight = np.zeros(3), 0.0
        if axis is not None and self.aims:
            wanted, weight = np.array(axis, dtype=float), max(0.3 * chain.reach, 1e-3)
        q = np.clip(pose[chain.index], lower, upper)
        descend(self._tables, q, lower, upper, target.copy(), wanted, weight, _STEPS)
        moved = pose.copy()
        moved[chain.index] = q
        return moved, float(np.linalg.norm(self._robot.tool_position(moved) - target))
