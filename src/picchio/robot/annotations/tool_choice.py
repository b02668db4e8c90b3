"""Which frame carries the tool, and what is mounted there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from picchio.core.errors import InputError
from picchio.robot.annotations.flexibility import Source, strongest
from picchio.robot.annotations.other_tags import Srdf
from picchio.robot.annotations.sidecar import given, spreads_within
from picchio.robot.spread import Posterior, Spread
from picchio.robot.tool import Gun, Mounting, Tool
from picchio.robot.urdf.tree import UrdfTree

# Usual names of the frame at the end of an arm, the likeliest first.
USUAL = ("tool", "tcp", "tool0", "tool_frame", "ee_link", "flange", "link_tcp", "end_effector")


def choose_tool(
    tree: UrdfTree, argument: str | None, sources: Sequence[Source], srdf: Srdf | None
) -> tuple[Tool, dict[str, str]]:
    """The tool, and where its values are from.

    The frame: the argument, a sidecar or annotation, a usual name, the SRDF's end effector, or
    the only link that carries no other.

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
        values["frame"], origins["tool.frame"] = _usual_frame(tree, srdf)
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
    movable = set(tree.movable())
    leaves = [
        link for link in tree.leaves() if any(joint.name in movable for joint in tree.chain(link))
    ]
    if len(leaves) == 1:
        return leaves[0], "the only link at an end"
    if not movable:
        return tree.root, "the root: nothing moves"
    raise InputError("several frames could carry the tool", file=tree.path, key="tool",
                     choices=leaves, hint="name one with --tool, or as [tool] frame in the "
                     "sidecar")  # fmt: skip


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
    """The correlations of the strongest source that has some, among the values that are its own.

    Args:
        sources: the strongest first.
        spreads: of the robot as merged.
    """
    for source in sources:
        if (posterior := source.content.posterior) is not None:
            return posterior.among({s.name for s in spreads if s.source.startswith(source.label)})
    return None
