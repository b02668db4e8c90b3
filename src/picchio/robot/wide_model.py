"""The robot's Pinocchio model on a base that moves, with two hinges beside every joint.

The base's six joints and the hinges stand still in the robot as its URDF has it; an effect on the
model may let some of them yield.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from picchio.core.arrays import FloatArray
from picchio.robot.flexible_robot import FlexibleRobot

BASE_AXES = ("x", "y", "z", "rx", "ry", "rz")


def widen(robot: FlexibleRobot, source: Any) -> tuple[Any, dict[int, int], list[str]]:
    """The wide model, where each of the source's joints is in it, and who has hinges.

    Args:
        robot: whose flexible revolute joints get hinges, perpendicular to the joint's axis.
        source: its Pinocchio model.

    Returns:
        the model; its joint's number by the source's; the names of the joints with hinges, whose
        joints are "hinge.<joint>.1" and ".2". The base's are "base.x" to "base.rz".
    """
    root = root_position(robot)
    model = pin.Model()
    model.gravity = source.gravity
    parent = 0
    kinds = (pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ,
             pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ)  # fmt: skip
    for i, (axis, kind) in enumerate(zip(BASE_AXES, kinds, strict=True)):
        place = pin.SE3(np.eye(3), root if i == 0 else np.zeros(3))
        parent = model.addJoint(parent, kind(), place, f"base.{axis}")
    from_root = pin.SE3(np.eye(3), -root)
    model.appendBodyToJoint(parent, from_root.act(source.inertias[0]), pin.SE3.Identity())
    where, hinges = {0: parent}, []
    for i in range(1, source.njoints):
        name, place = source.names[i], source.jointPlacements[i]
        if source.parents[i] == 0:
            place = from_root * place
        at = where[source.parents[i]]
        turns, own = _axis(source.joints[i])
        if turns and name in robot.flexible_names:
            hinges.append(name)
            first, second = _perpendicular(own)
            for k, side in enumerate((first, second)):
                joint = pin.JointModelRevoluteUnaligned(side)
                at = model.addJoint(at, joint, place, f"hinge.{name}.{k + 1}")
                place = pin.SE3.Identity()
        kind = pin.JointModelRevoluteUnaligned if turns else pin.JointModelPrismaticUnaligned
        where[i] = model.addJoint(at, kind(own), place, name)
        model.appendBodyToJoint(where[i], source.inertias[i], pin.SE3.Identity())
    return model, where, hinges


def root_position(robot: FlexibleRobot) -> FloatArray:
    """(3,) m, where the root link stands; the base turns about it."""
    model = robot.rigid._model
    root = model.frames[robot.rigid.frame(robot.tree.root)]
    return np.array(root.placement.translation)


def _axis(joint: Any) -> tuple[bool, FloatArray]:
    """Whether a joint of one degree of freedom turns, and its axis in its own frame."""
    column = np.array(joint.createData().S).reshape(6)
    angular = column[3:]
    return bool(np.abs(angular).max() > 0.5), angular if np.abs(angular).max() > 0.5 else column[:3]


def _perpendicular(axis: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two unit vectors that are perpendicular to an axis and to each other."""
    helper = np.eye(3)[int(np.abs(axis).argmin())]
    first = np.cross(axis, helper)
    first /= np.linalg.norm(first)
    return first, np.cross(axis, first)
