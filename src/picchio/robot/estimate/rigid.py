"""Which joints of a robot have no drive to estimate, and why."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

from picchio.robot.masses.check import carrying
from picchio.robot.urdf.tree import MOVABLE

if TYPE_CHECKING:
    from picchio.robot.flexible_robot import FlexibleRobot


def left_rigid(robot: FlexibleRobot, estimated: Collection[str]) -> dict[str, list[str]]:
    """The joints that an estimate leaves rigid.

    Args:
        robot: whose they are.
        estimated: the joints that have an estimate.

    Returns:
        their names, by the reason in words.
    """
    tree = robot.tree
    moving = {joint.name for joint in tree.chain(robot.tool_frame)}
    locked = set(tree.locked())
    found: dict[str, list[str]] = {}
    for name, joint in tree.joints.items():
        if name in estimated:
            continue
        if name in locked:
            reason = "joints of several degrees of freedom, held fixed"
        elif joint.type not in MOVABLE:
            continue
        elif joint.mimic is not None:
            reason = "joints that follow another one"
        elif name not in moving:
            reason = "joints that do not move the tool"
        elif joint.type == "prismatic":
            reason = "sliding joints, since no drive of one was measured"
        elif name not in carrying(robot, [name]):
            reason = "joints beyond which the URDF gives no mass, or one that cannot be"
        else:
            reason = "joints that hardly turn the tool"
        found.setdefault(reason, []).append(name)
    return found
