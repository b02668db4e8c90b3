"""The robot's second-order geometry at one pose, computed once and shared by every model."""

from __future__ import annotations

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.robot import FlexibleRobot
from picchio.robot.expansion import Inertia, Motion, WideChain


class Geometry:
    """Inertia and kinematics of a robot about one pose; what is asked for is kept.

    Args:
        chain: the robot on further coordinates.
        pose: (nv,) rad or m.
    """

    def __init__(self, chain: WideChain, pose: FloatArray) -> None:
        self.chain = chain
        self.pose = pose
        self._inertias: dict[object, Inertia] = {}
        self._motions: dict[str, Motion] = {}
        state = chain.robot.state(pose)
        self.stiffness = state.stiffness
        self.gravity_torque = state.gravity_torque

    @classmethod
    def of(cls, robot: FlexibleRobot, pose: FloatArray) -> Geometry:
        """The geometry of a robot at a pose."""
        return cls(WideChain(robot), robot.pose(pose))

    @property
    def robot(self) -> FlexibleRobot:
        """The robot."""
        return self.chain.robot

    def inertia(self, what: str = "robot", point: tuple[float, ...] | None = None) -> Inertia:
        """As `WideChain.inertia`."""
        key = (what, point)
        if key not in self._inertias:
            given = what if point is None else (what, np.asarray(point, dtype=float))
            self._inertias[key] = self.chain.inertia(self.pose, given)
        return self._inertias[key]

    def motion(self, frame: str) -> Motion:
        """As `WideChain.motion`; a joint's name means the link that it carries."""
        link = frame if self.chain.has_frame(frame) else self.robot.link_of(frame)
        if link not in self._motions:
            self._motions[link] = self.chain.motion(self.pose, link)
        return self._motions[link]
