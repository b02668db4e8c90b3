"""Whether the robot's own links touch at a pose, where its URDF has collision meshes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from picchio.core.arrays import FloatArray
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.ik.chain import tool_chain
from picchio.robot.urdf.addresses import package_roots
from picchio.robot.urdf.tree import without_quaternions
from picchio.robot.urdf.xml import parse_urdf, read_urdf_bytes

_SAMPLES = 100
# Pairs that touch in nearly all poses are drawn to touch (MoveIt's assistant takes 95 %).
_ALWAYS = 0.95


@dataclass(frozen=True, eq=False)
class SelfCollision:
    """Collision pairs of a robot: all but neighbours and links that touch nearly always."""

    _model: Any
    _geometry: Any
    _columns: dict[str, int]

    @classmethod
    def of(cls, robot: FlexibleRobot, rest: FloatArray) -> SelfCollision | str:
        """The check, or in words why there is none.

        Args:
            robot: whose URDF is read.
            rest: (nv,) where joints stand that do not move the tool, such as fingers.
        """
        root = parse_urdf(read_urdf_bytes(robot.source), robot.source)
        if root.find("link/collision/geometry/capsule") is not None:
            return "the URDF's collision shapes have capsules, which are not looked at"
        text = without_quaternions(root)
        folders = [str(folder) for folder in (*package_roots(), robot.source.parent)]
        try:
            model = pin.buildModelFromXML(text)
            geometry = pin.buildGeomFromUrdfString(
                model, text, pin.GeometryType.COLLISION, None, folders
            )
        except (ValueError, RuntimeError) as error:
            return f"the collision meshes cannot be loaded ({' '.join(str(error).split())[:120]})"
        if geometry.ngeoms < 2:
            return "the URDF has no collision meshes"
        geometry.addAllCollisionPairs()
        columns = {name: k for k, name in enumerate(robot.joint_names)}
        found = cls(model, geometry, columns)
        found._forget(_touching_by_design(model, geometry))
        lower = np.where(np.isfinite(robot.lower), robot.lower, -np.pi)
        upper = np.where(np.isfinite(robot.upper), robot.upper, np.pi)
        poses = np.tile(rest, (_SAMPLES, 1))
        own = tool_chain(robot).index
        poses[:, own] = np.random.default_rng(0).uniform(
            lower[own], upper[own], (_SAMPLES, len(own))
        )
        hits = np.array([found._touching(pose) for pose in poses]).reshape(_SAMPLES, -1)
        found._forget(np.flatnonzero(hits.mean(axis=0) >= _ALWAYS).tolist())
        if not found.pairs:
            return "no two links of the URDF could collide"
        return found

    @property
    def pairs(self) -> int:
        """How many are checked."""
        return len(self._geometry.collisionPairs)

    def collides(self, pose: FloatArray) -> bool:
        """Whether two links touch at a pose (nv,).

        Args:
            pose: (nv,) rad or m.
        """
        return any(self._touching(pose, until_one_does=True))

    def touching(self, pose: FloatArray) -> list[tuple[str, str]]:
        """The links that touch at a pose, in pairs.

        Args:
            pose: (nv,) rad or m.
        """
        found = zip(self._geometry.collisionPairs, self._touching(pose), strict=True)
        ends = {(self._link(pair.first), self._link(pair.second)) for pair, hit in found if hit}
        return sorted(ends)

    def _link(self, shape: int) -> str:
        frame = self._geometry.geometryObjects[shape].parentFrame
        return str(self._model.frames[frame].name)

    def _touching(self, pose: FloatArray, *, until_one_does: bool = False) -> list[bool]:
        """Whether each pair touches; pairs after the first that does may be left out."""
        data, shapes = self._model.createData(), self._geometry.createData()
        q = self._configuration(pose)
        pin.computeCollisions(self._model, data, self._geometry, shapes, q, until_one_does)
        return [result.isCollision() for result in shapes.collisionResults]

    def _forget(self, pairs: list[int]) -> None:
        # Copies: what the vector hands out refers into it, and moves as pairs are removed.
        ends = [(p.first, p.second) for p in self._geometry.collisionPairs]
        for k in pairs:
            self._geometry.removeCollisionPair(pin.CollisionPair(*ends[k]))

    def _configuration(self, pose: FloatArray) -> FloatArray:
        """Pinocchio's q: a continuous joint is a cosine and a sine; mimics stay at rest."""
        q = pin.neutral(self._model)
        for joint in range(1, self._model.njoints):
            column = self._columns.get(self._model.names[joint])
            if column is None:
                continue
            at = self._model.joints[joint].idx_q
            if self._model.joints[joint].nq == 2:
                q[at : at + 2] = np.cos(pose[column]), np.sin(pose[column])
            else:
                q[at] = pose[column]
        return np.asarray(q)


def _touching_by_design(model: Any, geometry: Any) -> list[int]:
    """Pairs on one body, or on bodies that one joint connects."""
    found = []
    for k, pair in enumerate(geometry.collisionPairs):
        first = geometry.geometryObjects[pair.first].parentJoint
        second = geometry.geometryObjects[pair.second].parentJoint
        if first == second or model.parents[first] == second or model.parents[second] == first:
            found.append(k)
    return found
