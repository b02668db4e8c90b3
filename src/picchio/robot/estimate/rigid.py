"""Which joints of a robot have no spring, and why."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING, NamedTuple

from picchio.robot.masses.check import carrying
from picchio.robot.spread import is_estimate
from picchio.robot.urdf.check import bad_inertia
from picchio.robot.urdf.tree import MOVABLE

if TYPE_CHECKING:
    from picchio.robot.flexible_robot import FlexibleRobot


class LeftRigid(NamedTuple):
    """A joint that was left out.

    Attributes:
        joint: its name.
        why: in words that follow the name.
        moves_tool: whether a drive of its own moves the tool, so that the blows load it.
    """

    joint: str
    why: str
    moves_tool: bool


def left_rigid(
    robot: FlexibleRobot, estimated: Collection[str] | None = None
) -> tuple[LeftRigid, ...]:
    """The joints that can move and have no spring.

    Args:
        robot: whose they are.
        estimated: the joints that have an estimate; if not given, those that are flexible.

    Returns:
        in the URDF's order.
    """
    tree = robot.tree
    flexible = robot.flexible_names if estimated is None else estimated
    # Where a file gives stiffnesses, what it leaves out it leaves rigid.
    stated = estimated is None and not any(
        is_estimate(robot.origins.get(f"{name}.stiffness", "")) for name in flexible
    )
    chain = {joint.name for joint in tree.chain(robot.tool_frame)}
    locked = set(tree.locked())
    found = []
    for name, joint in tree.joints.items():
        if name in flexible or not (name in locked or joint.type in MOVABLE):
            continue
        moves = False
        if name in locked:
            why = "has several degrees of freedom and is held fixed"
        elif joint.mimic is not None:
            why = "follows another joint"
        elif name not in chain:
            why = "does not move the tool"
        else:
            moves, why = True, _why(robot, name, stated=stated)
        found.append(LeftRigid(name, why, moves))
    return tuple(found)


def _why(robot: FlexibleRobot, name: str, *, stated: bool) -> str:
    """Why a joint that moves the tool has no spring."""
    tree = robot.tree
    bodies = {link: body for link in tree.beyond(name) if (body := tree.links[link]) is not None}
    wrong = next((link for link, body in bodies.items() if bad_inertia(body)), None)
    if stated:
        return "no stiffness is given"
    if tree.joints[name].type == "prismatic":
        return "slides, and no drive of a slide was measured"
    if wrong is not None:
        return f"moves {wrong}, and {bad_inertia(bodies[wrong])}"
    if name not in carrying(robot, [name]):
        return "moves no mass that the URDF gives"
    return "hardly turns the tool"
