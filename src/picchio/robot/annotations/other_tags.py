"""What other tools say of a robot, in its URDF or in the SRDF beside it; no stiffness is among it.

Drake: `<transmission><actuator><drake:rotor_inertia value=/><drake:gear_ratio value=/>`.
SRDF: named poses, end effectors, and, as Pinocchio reads it, `<rotor_params><joint name= mass=
gear_ratio=/>`, where `mass` is the rotor's inertia.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from lxml import etree

from picchio.core.errors import InputError, warn_user
from picchio.robot.annotations.sidecar import JointEntry, Sidecar
from picchio.robot.urdf.tree import UrdfTree, to_number
from picchio.robot.urdf.xml import children, local_name, parse_urdf, read_urdf_bytes


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

    A file of the URDF's own name that cannot be read is told: picchio can do without it.

    Args:
        tree: of the URDF.

    Returns:
        what it says, or None where there is none.
    """
    folders = (tree.path.parent, tree.path.parent.parent / "srdf")
    files = [file for folder in folders for file in sorted(folder.glob("*.srdf"))]
    files.sort(key=lambda file: file.stem != tree.path.stem)
    for file in files:
        try:
            root = parse_urdf(read_urdf_bytes(file), file)
        except InputError as error:
            if file.stem == tree.path.stem:
                warn_user(f"{error}: its poses and end effectors are not used")
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
    return Srdf(file, poses, effectors, _rotor_params(root))


def _angle(text: str | None) -> float | None:
    """One number, or cosine and sine of a continuous joint; None for anything else."""
    try:
        values = [to_number(part) for part in (text or "").split()]
    except ValueError:
        return None
    if len(values) == 2:
        return math.atan2(values[1], values[0])
    return values[0] if len(values) == 1 else None


def read_drake(root: etree._Element) -> Sidecar | None:
    """Rotor inertias and gear ratios in Drake's tags, or None where there are none."""
    return _drives(
        (joint.get("name"), local_name(element), element.get("value"))
        for transmission in children(root, "transmission")
        for actuator in children(transmission, "actuator")
        for element in actuator
        for joint in children(transmission, "joint")
        if local_name(element) in ("rotor_inertia", "gear_ratio")
        and element.tag != local_name(element)
    )


def _rotor_params(srdf: etree._Element) -> Sidecar | None:
    """The SRDF's `<rotor_params>`, or None where there are none."""
    return _drives(
        (joint.get("name"), key, joint.get(attribute))
        for block in children(srdf, "rotor_params")
        for joint in children(block, "joint")
        for attribute, key in (("mass", "rotor_inertia"), ("gear_ratio", "gear_ratio"))
    )


def _drives(found: Iterable[tuple[str | None, str, str | None]]) -> Sidecar | None:
    """What (joint, key, text) say; other tools' tags are passed over, not refused, if unusable."""
    joints: dict[str, dict[str, float]] = {}
    for name, key, text in found:
        try:
            value = to_number(text or "")
        except ValueError:
            continue
        if name and (value >= 0 if key == "rotor_inertia" else value != 0):
            joints.setdefault(name, {})[key] = value
    entries = {name: JointEntry.model_validate(entry) for name, entry in joints.items()}
    return Sidecar(joint=entries) if entries else None
