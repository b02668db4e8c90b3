"""The joints between the base and the tool point, as plain tables for compiled code."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from picchio.robot.urdf.tree import MOVABLE

if TYPE_CHECKING:
    from picchio.robot.flexible_robot import FlexibleRobot

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Chain:
    """m movable joints in a row, moved by k coordinates of the pose.

    Args:
        rotation: (m + 1, 3, 3), from the joint before (the world for the first) to this one; the
            last row leads to the tool point.
        offset: (m + 1, 3) m, likewise.
        axis: (m, 3), unit, in the joint's frame.
        slides: (m,) true for prismatic joints.
        follow: (m, k), joint positions = follow @ q + shift; the identity without mimic joints.
        shift: (m,).
        index: (k,) of the coordinates in the pose.
        lower: (k,) rad or m, -inf where there is no limit.
        upper: (k,).
        tool_axis: (3,), unit, in the tool point's frame.
    """

    rotation: Array
    offset: Array
    axis: Array
    slides: NDArray[np.bool_]
    follow: Array
    shift: Array
    index: NDArray[np.intp]
    lower: Array
    upper: Array
    tool_axis: Array

    @property
    def wraps(self) -> NDArray[np.bool_]:
        """(k,) true for angles, which mean the same after a full turn."""
        return ~((self.slides[:, None] & (self.follow != 0.0)).any(axis=0))

    @property
    def tables(self) -> tuple[NDArray[Any], ...]:
        """The chain as the compiled code takes it."""
        return (self.rotation, self.offset, self.axis, self.slides, self.follow, self.shift,
                self.tool_axis)  # fmt: skip

    @property
    def reach(self) -> float:
        """A length, m, beyond which nothing can be reached if all joints are revolute."""
        return float(np.linalg.norm(self.offset[1:], axis=1).sum()) or 1.0


def tool_chain(robot: FlexibleRobot) -> Chain:
    """The chain to the point where the force acts; a gun's recoil stays at rest."""
    rotation, offset = pin.rpy.rpyToMatrix(*robot.mounting.rpy), np.array(robot.mounting.xyz)
    rotations, offsets, axes, slides, follows, shifts = [], [], [], [], [], []
    for joint in robot.tree.chain(robot.tool.frame):
        offset = offset + rotation @ np.array(joint.xyz)
        rotation = rotation @ pin.rpy.rpyToMatrix(*joint.rpy)
        if joint.type not in MOVABLE:
            continue
        rotations.append(rotation)
        offsets.append(offset)
        rotation, offset = np.eye(3), np.zeros(3)
        axes.append(np.array(joint.axis) / np.linalg.norm(joint.axis))
        slides.append(joint.type == "prismatic")
        row, shift = robot.rigid.followed(joint.name)
        follows.append(row)
        shifts.append(shift)
    rotations.append(rotation)
    offsets.append(offset + rotation @ np.array(robot.tool.xyz))
    follow = np.array(follows).reshape(len(axes), robot.rigid.nv)
    index = np.flatnonzero((follow != 0.0).any(axis=0))
    return Chain(
        np.array(rotations),
        np.array(offsets),
        np.array(axes).reshape(-1, 3),
        np.array(slides, dtype=np.bool_),
        np.ascontiguousarray(follow[:, index]),
        np.array(shifts),
        index,
        robot.lower[index],
        robot.upper[index],
        np.array(robot.tool.axis),
    )
