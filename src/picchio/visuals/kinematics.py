"""The robot's tree as nested frames, so that the page can bend its joints itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from picchio.core.arrays import FloatArray
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.urdf.shapes import placement
from picchio.robot.urdf.tree import MOVABLE, UrdfJoint


@dataclass(frozen=True, eq=False)
class Frame:
    """One link's place under its parent.

    Attributes:
        link: its name.
        path: of its node in the scene; made of numbers, never of names.
        matrix: (4, 4) of the joint's frame in the parent link's.
        axis: (3,) of the joint in its own frame, or None where it is fixed.
        prismatic: whether it slides.
        position: rad or m, at the scene's pose.
        follows: (n,) rad or m by deflection of each flexible joint; zeros where it stands still.
        joint: the URDF joint that carries it, or None for the root.
    """

    link: str
    path: str
    matrix: FloatArray
    axis: FloatArray | None
    prismatic: bool
    position: float
    follows: FloatArray
    joint: str | None


def frames(robot: FlexibleRobot, pose: FloatArray) -> list[Frame]:
    """Every link's frame at a pose, parents before children."""
    tree, mounting = robot.tree, robot.mounting
    n = len(robot.flexible_joints)
    below: dict[str, list[UrdfJoint]] = {}
    for joint in tree.joints.values():
        below.setdefault(joint.parent, []).append(joint)
    base = placement(mounting.xyz, mounting.rpy)
    found = [Frame(tree.root, "robot/0", base, None, False, 0.0, np.zeros(n), None)]
    for parent in found:
        for joint in below.get(parent.link, ()):
            axis = None
            position, follows = 0.0, np.zeros(n)
            if joint.type in MOVABLE:
                axis = np.array(joint.axis) / np.linalg.norm(joint.axis)
                row, shift = robot.rigid.followed(joint.name)
                position = float(row @ pose + shift)
                follows = row[robot.flexible_index]
            path = f"{parent.path}/{len(found)}"
            found.append(
                Frame(joint.child, path, placement(joint.xyz, joint.rpy), axis,
                      joint.type == "prismatic", position, follows, joint.name)
            )  # fmt: skip
    if robot.gun is not None:
        found.append(_gun(robot, pose, found))
    return found


def _gun(robot: FlexibleRobot, pose: FloatArray, found: list[Frame]) -> Frame:
    """The gun's body, which no URDF has: at the tool point, sliding on its recoil spring if any."""
    holder = next(frame for frame in found if frame.link == robot.tool.frame)
    path = f"{holder.path}/{len(found)}"
    at = placement(robot.tool.xyz, np.zeros(3))
    follows = np.zeros(len(robot.flexible_joints))
    recoil = next((name for name in robot.joint_names if name not in robot.tree.joints), None)
    if recoil is None:
        return Frame(robot.tool_point, path, at, None, False, 0.0, follows, None)
    follows[robot.flexible_names.index(recoil)] = 1.0
    axis = np.array(robot.tool.axis) / np.linalg.norm(robot.tool.axis)
    position = float(pose[robot.joint_names.index(recoil)])
    return Frame(robot.tool_point, path, at, axis, True, position, follows, recoil)


def joint_motion(frame: Frame) -> FloatArray:
    """(4, 4) that a frame's joint adds at its position."""
    matrix = np.eye(4)
    if frame.axis is None:
        return matrix
    if frame.prismatic:
        matrix[:3, 3] = frame.axis * frame.position
    else:
        matrix[:3, :3] = pin.exp3(frame.axis * frame.position)
    return matrix


def world(all_frames: list[Frame]) -> dict[str, FloatArray]:
    """(4, 4) world placement of every link."""
    at: dict[str, FloatArray] = {}
    for frame in all_frames:
        parent = frame.path.rpartition("/")[0]
        above = at.get(parent, np.eye(4))
        at[frame.path] = above @ frame.matrix @ joint_motion(frame)
    return {frame.link: at[frame.path] for frame in all_frames}
