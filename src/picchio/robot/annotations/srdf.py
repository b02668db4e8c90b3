"""The SRDF beside a URDF: named poses, end effectors, rotor parameters."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from lxml import etree

from picchio.core.errors import InputError
from picchio.robot.annotations.other_tags import read_rotor_params
from picchio.robot.annotations.sidecar import Sidecar
from picchio.robot.urdf.tree import UrdfTree, to_number
from picchio.robot.urdf.xml import children, parse_urdf, read_urdf_bytes


@dataclass(frozen=True)
class Srdf:
    """What an SRDF says about a robot.

    Args:
        path: the file.
        poses: joint values [rad, m] by pose name and joint name.
        end_effectors: links that carry an end effector.
        rotors: rotor inertias and gear ratios, or None.
    """

    path: Path
    poses: dict[str, dict[str, float]]
    end_effectors: tuple[str, ...]
    rotors: Sidecar | None


def find_srdf(tree: UrdfTree) -> Srdf | None:
    """The SRDF that goes with a URDF: same stem or robot name, beside it or in `../srdf`.

    A file that cannot be read is passed over: picchio can do without it.
    """
    folders = (tree.path.parent, tree.path.parent.parent / "srdf")
    files = [file for folder in folders for file in sorted(folder.glob("*.srdf"))]
    files.sort(key=lambda file: file.stem != tree.path.stem)
    for file in files:
        try:
            root = parse_urdf(read_urdf_bytes(file), file)
        except InputError:
            continue
        if file.stem == tree.path.stem or root.get("name") == tree.name:
            return _read(root, file, tree)
    return None


def _read(root: etree._Element, file: Path, tree: UrdfTree) -> Srdf:
    poses: dict[str, dict[str, float]] = {}
    for state in children(root, "group_state"):
        values = {}
        for joint in children(state, "joint"):
            angle = _angle(joint.get("value"))
            name = joint.get("name")
            if name in tree.joints and angle is not None:
                values[name] = angle
        if state.get("name") and values:
            poses.setdefault(state.get("name", ""), {}).update(values)
    effectors = tuple(
        link
        for element in children(root, "end_effector")
        if (link := element.get("parent_link")) in tree.links and link
    )
    return Srdf(file, poses, effectors, read_rotor_params(root))


def _angle(text: str | None) -> float | None:
    """One number, or cosine and sine of a continuous joint; None for anything else."""
    try:
        values = [to_number(part) for part in (text or "").split()]
    except ValueError:
        return None
    if len(values) == 2:
        return math.atan2(values[1], values[0])
    return values[0] if len(values) == 1 else None
