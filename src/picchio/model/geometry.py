"""The robot's second-order geometry at one pose, computed once and shared by every model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.recent import Recent
from picchio.model.expansion import Bent, WideChain
from picchio.model.swept import Inertia, Motion, Swept
from picchio.robot.flexible_robot import FlexibleRobot

if TYPE_CHECKING:
    from picchio.model.plant import Plant

# Of which sets of masses the inertias are kept side by side: weights change more often than they.
_KEPT_STACKS = 8
_KEPT_PLANTS = 256
_KEPT_BESIDE = 32


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
        self._motions: dict[object, Motion] = {}
        self._sweeps: dict[tuple[int, ...] | None, Swept] = {}
        self._stacks: Recent[FloatArray] = Recent(_KEPT_STACKS)
        # Records of one pose share theirs.
        self.plants: Recent[Plant] = Recent(_KEPT_PLANTS)
        self.begun: Recent[Plant] = Recent(_KEPT_BESIDE)
        self._beside: Recent[Geometry] = Recent(_KEPT_BESIDE)
        self._bent: Recent[Geometry] = Recent(_KEPT_BESIDE)
        state = chain.robot.state(pose)
        self.stiffness = state.stiffness
        self.gravity_torque = state.gravity_torque

    @classmethod
    def of(cls, robot: FlexibleRobot, pose: FloatArray) -> Geometry:
        """The geometry of a robot at a pose.

        Args:
            robot: the robot.
            pose: (nv,) rad or m.
        """
        return cls(WideChain(robot), robot.pose(pose))

    @property
    def robot(self) -> FlexibleRobot:
        """The robot."""
        return self.chain.robot

    def inertia(
        self,
        what: str = "robot",
        point: tuple[float, ...] | None = None,
        taken: tuple[int, ...] | None = None,
    ) -> Inertia:
        """Mass matrix and gravity about the pose, to second order.

        Args:
            what: "robot", or a link, for what that link alone adds.
            point: (3,) m in the link's axes: of 1 kg there instead of the link.
            taken: only these of the chain's coordinates.

        Returns:
            kept: the same object for the same question.
        """
        key = (what, point, taken)
        if key not in self._inertias:
            if point is not None:
                joint, axes, origin = self.chain.place(what)
                found = self._swept(taken).inertia(joint, axes @ point + origin)
            elif taken is not None:
                found = self.inertia(what).take(taken)
            else:
                found = self.chain.inertia(self.pose, what)
            self._inertias[key] = found
        return self._inertias[key]

    def _swept(self, taken: tuple[int, ...] | None = None) -> Swept:
        if taken not in self._sweeps:
            whole = self.chain.swept(self.pose) if taken is None else self._swept()
            self._sweeps[taken] = whole if taken is None else whole.take(taken)
        return self._sweeps[taken]

    def beside(self, pose: FloatArray) -> Geometry:
        """The geometry of the same robot at a pose nearby.

        Args:
            pose: (nv,) rad or m.
        """
        return self._beside.get(pose.tobytes(), lambda: Geometry(self.chain, pose))

    def bending(self, bent: Bent) -> Geometry:
        """The geometry of the same robot at the same pose with links that bend.

        Args:
            bent: see `expansion.Bent`.
        """
        if not bent:
            return self
        return self._bent.get(bent, lambda: Geometry(self.chain.bending(bent), self.pose))

    def total(
        self, masses: Mapping[tuple[str, tuple[float, ...] | None], float], taken: tuple[int, ...]
    ) -> Inertia:
        """The weighted sum of inertias, of some of the coordinates.

        Args:
            masses: weight of (link or "robot", point) each.
            taken: which coordinates of the chain.
        """
        every = tuple(masses)

        def make() -> FloatArray:
            parts = [vars(self.inertia(what, point, taken)).values() for what, point in every]
            return np.stack([np.concatenate([own.ravel() for own in part]) for part in parts])

        # One product for all that an inertia is made of: it is asked for many thousand times.
        flat = np.array(list(masses.values())) @ self._stacks.get((every, taken), make)
        found, at = {}, 0
        for name, own in vars(self.inertia(*every[0], taken)).items():
            shape = (len(taken),) * own.ndim
            found[name] = flat[at : (at := at + len(taken) ** own.ndim)].reshape(shape)
        return Inertia(**found)

    def motion(self, frame: str, taken: tuple[int, ...] | None = None) -> Motion:
        """How the origin of a frame moves; a joint's name means the link that it carries.

        Args:
            frame: of the robot.
            taken: only these of the chain's coordinates.
        """
        if taken is not None:
            if (frame, taken) not in self._motions:
                self._motions[frame, taken] = self.motion(frame).take(list(taken))
            return self._motions[frame, taken]
        link = frame if self.chain.has_frame(frame) else self.robot.link_of(frame)
        if link not in self._motions:
            self._motions[link] = self._swept().motion(*self.chain.place(link))
        return self._motions[link]
