"""Choice among several poses that reach the same point.

Arms of three joints: "elbow-up" or "elbow-down". Any arm: words such as "joint_3+" and
"joint_5-", the sign of that joint's angle, alone or in a list.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.robot.urdf.tree import MOVABLE

if TYPE_CHECKING:
    from picchio.robot.flexible_robot import FlexibleRobot

ELBOW = ("elbow-up", "elbow-down")


def choose_branch(
    robot: FlexibleRobot, poses: list[FloatArray], words: Sequence[str], point: Any = None
) -> FloatArray:
    """The first pose on a branch.

    Args:
        robot: the robot.
        poses: (nv,) each, the preferred first; at least one.
        words: of `branch_words`.
        point: named in errors.

    Raises:
        InputError: no pose on this branch.
    """
    for pose in poses:
        if all(_fits(robot, pose, word) for word in words):
            return pose
    labels = sorted({branch_label(robot, pose) for pose in poses})
    raise InputError("the point cannot be reached on this branch within the limits",
                     key="branch", value=" ".join(words), choices=["any", *labels],
                     hint=f"point {point}")  # fmt: skip


def branch_label(robot: FlexibleRobot, pose: FloatArray) -> str:
    """The branch a pose is on: "elbow-up" or "elbow-down", or the signs of the joints."""
    names = tool_joints(robot)
    if len(names) == 3:
        return ELBOW[0] if _elbow_is_up(robot, pose, names) else ELBOW[1]
    index = robot.joint_names.index
    return " ".join(f"{name}{'+' if pose[index(name)] >= 0 else '-'}" for name in names)


def tool_joints(robot: FlexibleRobot) -> list[str]:
    """The joints between the base and the tool, in that order; mimics are not among them."""
    chain = robot.tree.chain(robot.tool.frame)
    return [joint.name for joint in chain if joint.type in MOVABLE and joint.mimic is None]


def branch_words(robot: FlexibleRobot, branch: str | Sequence[str]) -> list[str]:
    """The words of a branch, checked.

    Raises:
        InputError: no word, or one that this robot does not have.
    """
    words = branch.replace(",", " ").split() if isinstance(branch, str) else list(branch)
    names = tool_joints(robot)
    valid = ["any", *(ELBOW if len(names) == 3 else ()), *(n + s for n in names for s in "+-")]
    if not words:
        raise InputError("no branch given", key="branch", choices=valid)
    for word in words:
        if word not in valid:
            raise InputError("unknown branch", key="branch", value=word, choices=valid)
    return words


def _fits(robot: FlexibleRobot, pose: FloatArray, word: str) -> bool:
    if word == "any":
        return True
    if word in ELBOW:
        return _elbow_is_up(robot, pose, tool_joints(robot)) == (word == ELBOW[0])
    value = pose[robot.joint_names.index(word[:-1])]
    return bool(value >= 0) if word[-1] == "+" else bool(value <= 0)


def _elbow_is_up(robot: FlexibleRobot, pose: FloatArray, names: list[str]) -> bool:
    """Whether the third joint lies above the line from the second joint to the tool."""
    shoulder, _ = robot.frame_placement(pose, names[1])
    elbow, _ = robot.frame_placement(pose, names[2])
    tool = robot.state(pose).tool_position
    up = -np.asarray(robot.mounting.gravity)
    line = tool - shoulder
    across = (elbow - shoulder) - line * ((elbow - shoulder) @ line) / max(
        float(line @ line), 1e-12
    )
    height = float(across @ up)
    if abs(height) > 1e-9 * float(np.linalg.norm(up)):
        return height > 0
    # A vertical line has no upper side: the side away from the base's axis is called up.
    return float(across @ (shoulder - np.asarray(robot.mounting.xyz) + line)) >= 0
