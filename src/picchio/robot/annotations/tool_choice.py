"""Which frame carries the tool, and what is mounted there."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from picchio.core.errors import InputError
from picchio.robot.annotations.flexibility import Source, strongest
from picchio.robot.annotations.other_tags import Srdf
from picchio.robot.annotations.sidecar import given, spreads_within
from picchio.robot.spread import Posterior, Spread
from picchio.robot.tool import Gun, Mounting, Tool
from picchio.robot.urdf.shapes import placement
from picchio.robot.urdf.tree import MOVABLE, UrdfTree

if TYPE_CHECKING:
    from picchio.robot.flexible_robot import FlexibleRobot

# Usual names of the frame at the end of an arm, the likeliest first.
USUAL = ("tool", "tcp", "tool0", "tool_frame", "ee_link", "flange", "link_tcp", "end_effector")
# What such names end in, likewise.
CONVENTION = ("tcp", "tool0", "tool", "ee", "eef", "effector", "flange")

_CHOSEN = "chosen: "  # before the reason, where no file and nobody names the frame
_ON_AXIS = 1e-6  # m; a point nearer to an axis than this lies on it

_ARM = 3  # joints that lead to a hand, at least


def choose_tool(
    tree: UrdfTree, argument: str | None, sources: Sequence[Source], srdf: Srdf | None
) -> tuple[Tool, dict[str, str]]:
    """The tool, and where its values are from.

    The frame: the argument, a sidecar or annotation, a usual name, the SRDF's end effector, a name
    that ends as usual, the only place at which something ends, or where an arm's fingers begin.

    Raises:
        InputError: no such frame, or several links could be it.
    """
    values, origins = strongest(sources, "tool")
    for source in reversed(sources):
        if (stated := given(source.content.tool)) and "frame" in stated:
            values["frame"] = _link(tree, stated["frame"], source.file, "tool.frame")
    if argument is not None:
        values["frame"], origins["tool.frame"] = _link(tree, argument, None, "--tool"), "argument"
    if "frame" not in values:
        values["frame"], why = _usual_frame(tree, srdf)
        origins["tool.frame"] = _CHOSEN + why
    if "axis" in values:
        values["axis"] = tuple((np.array(values["axis"]) / np.linalg.norm(values["axis"])).tolist())
    return Tool.model_construct(**values), origins  # each value was checked where it stands


def _link(tree: UrdfTree, frame: str, file: str | None, key: str) -> str:
    if (link := tree.link_of(frame)) is not None:
        return link
    raise InputError("the robot has no frame of this name", file=file, key=key, value=frame,
                     choices=dict.fromkeys([*tree.leaves(), *tree.links]))  # fmt: skip


def _usual_frame(tree: UrdfTree, srdf: Srdf | None) -> tuple[str, str]:
    for name in USUAL:
        if name in tree.links:
            return name, f"the link is called {name!r}"
    if srdf is not None and len(set(srdf.end_effectors)) == 1:
        return srdf.end_effectors[0], f"{srdf.path.name}, end_effector"
    movable = tree.movable()
    if not movable:
        return tree.root, "the root: nothing moves"
    beyond = {link for joint in movable for link in tree.beyond(joint)}
    carried = [link for link in tree.links if link in beyond]
    for word in CONVENTION:
        named = [link for link in carried if _is_called(link, word)]
        if len({_place(tree, link) for link in named}) == 1:
            return named[0], f"the link's name ends in {word!r}, as the tool's frame usually does"
    ends = tree.leaves()
    leaves = [link for link in carried if link in ends]
    if len({_place(tree, link) for link in leaves}) == 1:
        return leaves[0], "the only place at an end"
    last = _last_of(tree, leaves)
    if len({_place(tree, link) for link in last}) == 1:
        return last[0], "the only place beyond all joints"
    if (branch := _where_it_branches(tree, last)) is not None:
        return branch, "where the arm ends and its fingers begin"
    raise InputError("several frames could carry the tool", file=tree.path, key="tool",
                     choices=leaves, hint="name one with --tool, or as [tool] frame in the "
                     "sidecar")  # fmt: skip


def _joints_to(tree: UrdfTree, link: str) -> list[str]:
    return [joint.name for joint in tree.chain(link) if joint.type in MOVABLE]


def _last_of(tree: UrdfTree, leaves: Sequence[str]) -> list[str]:
    """Those that do not stand on the way to another: what is fixed to an arm's middle does."""
    chains = [_joints_to(tree, link) for link in leaves]
    return [
        link
        for link, chain in zip(leaves, chains, strict=True)
        if not any(len(c) > len(chain) and c[: len(chain)] == chain for c in chains)
    ]


def _where_it_branches(tree: UrdfTree, leaves: Sequence[str]) -> str | None:
    """The link at which an arm becomes a hand: more joints lead there than from there to any end.

    None where the branches are as long as what leads to them (of a torso with arms, or of a hand),
    and where nothing branches.
    """
    moving = [_joints_to(tree, link) for link in leaves]
    common = 0
    while all(len(chain) > common for chain in moving) and (
        len({chain[common] for chain in moving}) == 1
    ):
        common += 1
    beyond = max(len(chain) for chain in moving) - common
    if common < _ARM or not 0 < beyond < common:
        return None
    hands = {tree.joints[chain[common]].parent for chain in moving if len(chain) > common}
    return hands.pop() if len(hands) == 1 else tree.joints[moving[0][common - 1]].child


def _is_called(link: str, word: str) -> bool:
    """Whether a name ends in a word, as "panda_hand_tcp" and "arm_tool_link" do."""
    parts = [part for part in re.split("[^a-z0-9]+", link.lower()) if part]
    while parts and parts[-1] in ("link", "frame"):
        parts.pop()
    return bool(parts) and parts[-1] == word


def _place(tree: UrdfTree, link: str) -> tuple[str, tuple[float, ...]]:
    """What a link is fixed to, and where: frames at one place are one."""
    matrix = np.eye(4)
    for joint in reversed(tree.chain(link)):
        if joint.type in MOVABLE:
            break
        matrix = placement(joint.xyz, joint.rpy) @ matrix
        link = joint.parent
    return link, tuple((matrix.round(6) + 0.0).ravel().tolist())


@dataclass(frozen=True)
class ToolPlace:
    """Where the blows act, and why there.

    Attributes:
        frame: the link whose frame carries the tool.
        link: the one that it is fixed to, behind the last joint that moves it.
        xyz: m, the point where the force acts, in that link.
        why: the frame was taken, in words.
        joint: the last joint that moves the tool, where the point lies on its axis; else "".
        doubt: what is odd about it, a sentence; "" where nothing is.
    """

    frame: str
    link: str
    xyz: tuple[float, float, float]
    why: str
    joint: str = ""
    doubt: str = ""

    def __str__(self) -> str:
        x, y, z = (f"{part + 0.0:.3g}" for part in self.xyz)
        text = f"frame {self.frame}, at ({x}, {y}, {z}) m in {self.link}, because {self.why}"
        return f"{text}; it lies on the axis of {self.joint}" if self.joint else text


def tool_place(robot: FlexibleRobot) -> ToolPlace:
    """Where a robot's tool is, and why there.

    Args:
        robot: as loaded.
    """
    tree, frame = robot.tree, robot.tool.frame
    link, rows = _place(tree, frame)
    matrix = np.array(rows).reshape(4, 4)
    point = matrix[:3, :3] @ robot.tool.xyz + matrix[:3, 3]
    origin = robot.origins.get("tool.frame", "")
    chosen = origin.startswith(_CHOSEN)
    why = origin.removeprefix(_CHOSEN) if chosen else f"{origin or 'the robot'} says so"
    last = next((joint for joint in tree.joints.values() if joint.child == link), None)
    name = doubt = ""
    if last is not None and last.type in ("revolute", "continuous"):
        axis = np.array(last.axis) / np.linalg.norm(last.axis)
        if np.linalg.norm(np.cross(axis, point)) < _ON_AXIS:
            name = last.name
            # A flange turns about the way that its tool points; a hinge's tool stands off it.
            rolls = np.linalg.norm(np.cross(axis, matrix[:3, :3] @ robot.tool.axis)) < _ON_AXIS
            if chosen and (frame == link or not rolls):
                doubt = (
                    f"the tool frame {frame} lies on the axis of {name}, its last joint, which no "
                    "blow there loads, and the joints before it less than a tool that stands off: "
                    "if it does, name its frame with --tool or give [tool] xyz in the sidecar"
                )
    return ToolPlace(frame, link, tuple(point.round(6).tolist()), why, name, doubt)


def choose_gun(sources: Sequence[Source]) -> tuple[Gun | None, dict[str, str]]:
    """The gun of the strongest source that has one, and where it is from."""
    for source in sources:
        if (gun := source.content.gun) is not None:
            origin = source.origin(gun.source)
            return gun, {f"gun.{key}": origin for key in Gun.model_fields if key != "source"}
    return None, {}


def choose_mounting(sources: Sequence[Source]) -> tuple[Mounting, dict[str, str]]:
    """How the robot stands: of each value the strongest source's."""
    values, origins = strongest(sources, "base")
    return Mounting.model_construct(**values), origins


def mounted_spreads(
    tool: Tool, gun: Gun | None, mounting: Mounting, origins: dict[str, str]
) -> list[Spread]:
    """How well the values of tool, gun and mounting are known.

    Args:
        tool: as chosen.
        gun: as chosen.
        mounting: as chosen.
        origins: where their values are from.

    Raises:
        InputError: a factor on zero.
    """
    found: list[Spread] = []
    for table, record in (("tool", tool), ("gun", gun), ("base", mounting)):
        if record is not None:
            for spread in spreads_within(record, table):
                source = origins.get(f"{table}.{spread.path[0]}", "")
                found.append(replace(spread, source=source))
    return found


def choose_posterior(sources: Sequence[Source], spreads: Sequence[Spread]) -> Posterior | None:
    """The correlations of the sources that have some, each among the values that are its own.

    Args:
        sources: the strongest first.
        spreads: of the robot as merged.
    """
    found: list[Posterior] = []
    for source in sources:
        if (posterior := source.content.posterior) is not None:
            own = {s.name for s in spreads if s.source.startswith(source.label)}
            part = posterior.among(own - {name for one in found for name in one.names})
            found += [part] if part is not None else []
    if len(found) < 2:
        return found[0] if found else None
    from scipy.linalg import block_diag  # takes a while to load

    whole = block_diag(*(part.correlation for part in found))
    names = tuple(name for part in found for name in part.names)
    return Posterior(names=names, correlation=tuple(map(tuple, whole.tolist())))
