"""Which frame carries the tool, and what is mounted there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from picchio.core.errors import InputError
from picchio.robot.annotations.flexibility import Source
from picchio.robot.annotations.sidecar import BaseEntry, GunEntry, ToolEntry, given
from picchio.robot.annotations.srdf import Srdf
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
    tool = Tool("")
    origins: dict[str, str] = {}
    for source in reversed(sources):
        entry: ToolEntry | None = source.content.tool
        values = given(entry)
        note = values.pop("source", None)
        if "frame" in values:
            values["frame"] = _link(tree, values["frame"], source.file, "tool.frame")
        tool = replace(tool, **values)
        origins.update({f"tool.{key}": source.origin(note) for key in values})
    if argument is not None:
        tool = replace(tool, frame=_link(tree, argument, None, "--tool"))
        origins["tool.frame"] = "argument"
    if not tool.frame:
        frame, why = _usual_frame(tree, srdf)
        tool = replace(tool, frame=frame)
        origins["tool.frame"] = why
    axis = np.asarray(tool.axis)
    x, y, z = (axis / np.linalg.norm(axis)).tolist()
    return replace(tool, axis=(x, y, z)), origins


def _link(tree: UrdfTree, frame: str, file: str | None, key: str) -> str:
    if frame in tree.links:
        return frame
    if frame in tree.joints:
        return tree.joints[frame].child
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
        entry: GunEntry | None = source.content.gun
        if entry is not None:
            values = entry.model_dump(exclude={"source"})
            origin = source.origin(entry.source)
            return Gun(**values), {f"gun.{key}": origin for key in values}
    return None, {}


def choose_mounting(sources: Sequence[Source]) -> tuple[Mounting, dict[str, str]]:
    """How the robot stands: of each value the strongest source's."""
    mounting = Mounting()
    origins: dict[str, str] = {}
    for source in reversed(sources):
        entry: BaseEntry | None = source.content.base
        values = given(entry)
        note = values.pop("source", None)
        mounting = replace(mounting, **values)
        origins.update({f"base.{key}": source.origin(note) for key in values})
    return mounting, origins
