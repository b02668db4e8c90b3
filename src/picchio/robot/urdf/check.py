"""Checks that a URDF is one tree that can move: Pinocchio accepts others, or crashes on them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from lxml import etree

from picchio.core.arrays import symmetric
from picchio.core.errors import InputError, describe_choices
from picchio.robot.urdf.tree import (
    ATTRIBUTES,
    MOVABLE,
    Inertial,
    UrdfJoint,
    UrdfTree,
    read_joints,
    read_links,
)
from picchio.robot.urdf.xml import local_name

# Pinocchio's reader recurses link by link, and dense matrices grow with the square.
MOST_LINKS = 2000
MOST_MOVABLE = 300
# kg m^2: CAD exports leave products of inertia of rounding size on a zero diagonal.
LEAST_MOMENT = 1e-12


def read_tree(root: etree._Element, path: Path) -> UrdfTree:
    """The checked tree of a URDF.

    Args:
        root: the parsed XML.
        path: named in errors.

    Raises:
        InputError: with the true reason why this is no robot.
    """
    try:
        return _tree(root, path)
    except InputError as error:
        raise error.placed(file=path) from None


def _tree(root: etree._Element, path: Path) -> UrdfTree:
    if local_name(root) != "robot":
        raise InputError("the first element must be <robot>", value=local_name(root))
    name = root.get("name")
    if not name:
        raise InputError("the robot has no name", hint='write <robot name="...">')
    links = read_links(root)
    if not links:
        raise InputError("the robot has no links")
    joints = read_joints(root)
    movable = sum(joint.type in MOVABLE for joint in joints.values())
    for what, count, most in (
        ("links", len(links), MOST_LINKS),
        ("movable joints", movable, MOST_MOVABLE),
    ):
        if count > most:
            raise InputError(f"has {count} {what}; at most {most} are accepted")
    base = _root_link(links, joints)
    remarks = (*_unread(root), *_settle_mimics(joints))
    return UrdfTree(name, links, joints, base, path, remarks)


def _unread(root: etree._Element) -> Iterator[str]:
    """The attributes that URDF 1.2 does not have, of the elements that place, weigh and limit."""
    found: dict[tuple[str, str], list[str]] = {}
    for owner in root:
        # What stands deeper is a simulator's own; what has a prefix is its own language's.
        for element in owner.iterfind("*") if owner.tag in ("link", "joint") else ():
            for part in (element, *element.iterfind("*")):
                for name in map(str, part.attrib):
                    if name in ATTRIBUTES.get(str(part.tag), name) or name.startswith("{"):
                        continue
                    where = f"{owner.tag} {owner.get('name')}"
                    found.setdefault((str(part.tag), name), []).append(where)
    for (tag, name), owners in found.items():
        some = ", ".join(dict.fromkeys(owners[:4])) + (" ..." if len(owners) > 4 else "")
        yield (f"<{tag}> has no attribute {name!r}, so it is not read (in {some}); "
               f"{describe_choices(name, ATTRIBUTES[tag])}")  # fmt: skip


def _root_link(links: dict[str, Inertial | None], joints: dict[str, UrdfJoint]) -> str:
    carrier: dict[str, UrdfJoint] = {}
    for joint in joints.values():
        for end in (joint.parent, joint.child):
            if end not in links:
                raise InputError("no link of this name", key=f"joint {joint.name}", value=end,
                                 choices=links)  # fmt: skip
        if joint.child in carrier:
            raise InputError(f"two joints carry link {joint.child!r}: "
                             f"{carrier[joint.child].name!r} and {joint.name!r}; a URDF is a "
                             "tree")  # fmt: skip
        carrier[joint.child] = joint
    roots = [name for name in links if name not in carrier]
    if not roots:
        raise InputError("the joints form a closed loop: every link has a parent")
    if len(roots) > 1:
        some = ", ".join(repr(name) for name in roots[:4]) + (" ..." if len(roots) > 4 else "")
        raise InputError(f"more than one root link: {some}", hint="join them with a joint")
    reached = {roots[0]}
    for link in links:
        trail: set[str] = set()
        here = link
        while here not in reached:
            if here in trail:
                raise InputError(f"the joints around link {here!r} form a closed loop")
            trail.add(here)
            here = carrier[here].parent
        reached |= trail
    return roots[0]


def _settle_mimics(joints: dict[str, UrdfJoint]) -> list[str]:
    """Free the joints that mimic nothing that moves, as Pinocchio does; say which."""
    remarks = []
    for joint in list(joints.values()):
        if joint.mimic is None:
            continue
        leader = joints.get(joint.mimic.joint)
        if leader is None or leader.type not in MOVABLE:
            joints[joint.name] = replace(joint, mimic=None)
            remarks.append(
                f"joint {joint.name!r} mimics {joint.mimic.joint!r}, which is no movable joint: "
                "it is taken as a joint of its own"
            )
    for joint in joints.values():
        seen = [joint.name]
        while (mimic := joints[seen[-1]].mimic) is not None:
            if mimic.joint in seen:
                raise InputError("mimic joints follow each other in a circle",
                                 key=f"joint {joint.name}")  # fmt: skip
            seen.append(mimic.joint)
    return remarks


def bad_inertia(inertial: Inertial) -> str | None:
    """Why a body's inertia cannot be, or None if it can.

    A tensor must be positive semidefinite. The triangle inequality, which many published
    URDFs break a little, is among a robot's findings.
    """
    principal = np.linalg.eigvalsh(symmetric(inertial.inertia))
    if principal[0] < -LEAST_MOMENT - 1e-9 * abs(principal).max():
        moments = ", ".join(f"{value:.4g}" for value in principal)
        return f"its inertia is not positive semidefinite (principal moments {moments} kg m^2)"
    return None
