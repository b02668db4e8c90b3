"""A URDF's tree of links and joints, with masses, axes and limits.

Visuals, collisions, transmissions and simulators' tags are ignored. Reading is stricter than
Pinocchio's, so that an error names what is wrong instead of saying "not a valid URDF".
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TypeVar, cast

import numpy as np
import pinocchio as pin
from lxml import etree

from picchio.core.arrays import FloatArray, Vector, symmetric
from picchio.core.errors import InputError
from picchio.robot.units import JointUnits, units_of
from picchio.robot.urdf.xml import EXPAND, children, local_name

T = TypeVar("T")
Numbers = TypeVar("Numbers", bound=tuple[float, ...])
_COUNTS = {3: "three", 4: "four"}
_UNIT_LENGTH = 0.01  # how far rounding may leave a quaternion from the length 1
MOVABLE = ("revolute", "continuous", "prismatic")
LOCKED = ("floating", "planar")
JOINT_TYPES = (*MOVABLE, *LOCKED, "fixed")
ZERO: Vector = (0.0, 0.0, 0.0)
INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
# Of URDF 1.2, which has more limits than are used here.
ATTRIBUTES = {
    "origin": ("xyz", "rpy", "quat_xyzw"),
    "mass": ("value",),
    "inertia": INERTIA,
    "axis": ("xyz",),
    "limit": ("lower", "upper", "effort", "velocity", "acceleration", "deceleration", "jerk"),
    "mimic": ("joint", "multiplier", "offset"),
}
# Above this a sum of squares in the dynamics is on its way to overflow.
LARGEST = 1e12
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?\Z")
_INFINITE = re.compile(r"[+-]?inf(inity)?\Z", re.IGNORECASE)


@dataclass(frozen=True)
class Inertial:
    """Mass [kg], centre of mass [m] and its frame, inertia about it (ixx ixy ixz iyy iyz izz)."""

    mass: float
    xyz: Vector
    rpy: Vector
    inertia: tuple[float, ...]

    @property
    def tensor(self) -> FloatArray:
        """The inertia as a matrix (3, 3)."""
        return symmetric(self.inertia)


@dataclass(frozen=True)
class Mimic:
    """A joint that follows another: position = multiplier x other + offset."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True)
class UrdfJoint:
    """A joint as the URDF has it: m, rad, N m or N, s; limits are infinite where it has none."""

    name: str
    type: str
    parent: str
    child: str
    xyz: Vector
    rpy: Vector
    axis: Vector
    lower: float
    upper: float
    effort: float
    velocity: float
    mimic: Mimic | None

    @property
    def units(self) -> JointUnits:
        """How its values are written."""
        return units_of(self.type)


@dataclass(frozen=True)
class UrdfTree:
    """Links and joints in the file's order.

    `root` is the link that no joint carries; `remarks` say what was not taken as written.
    """

    name: str
    links: dict[str, Inertial | None]
    joints: dict[str, UrdfJoint]
    root: str
    path: Path
    remarks: tuple[str, ...] = ()

    @cached_property
    def carriers(self) -> dict[str, UrdfJoint]:
        """The joint that carries a link, by the link's name; the root has none."""
        return {joint.child: joint for joint in self.joints.values()}

    @cached_property
    def carried(self) -> dict[str, list[UrdfJoint]]:
        """The joints on a link, by the link's name."""
        found: dict[str, list[UrdfJoint]] = {}
        for joint in self.joints.values():
            found.setdefault(joint.parent, []).append(joint)
        return found

    def movable(self) -> list[str]:
        """The joints that can be flexible: revolute, continuous and prismatic, and no mimics."""
        return [j.name for j in self.joints.values() if j.type in MOVABLE and j.mimic is None]

    def locked(self) -> list[str]:
        """The joints of several degrees of freedom, which stand still."""
        return [j.name for j in self.joints.values() if j.type in LOCKED]

    def leaves(self) -> list[str]:
        """The links that carry no joint."""
        return [name for name in self.links if name not in self.carried]

    def link_of(self, frame: str) -> str | None:
        """The link whose frame this is, or None.

        Args:
            frame: a link's name, or a joint's for the link it carries.
        """
        if frame in self.links:
            return frame
        return self.joints[frame].child if frame in self.joints else None

    def chain(self, link: str) -> list[UrdfJoint]:
        """The joints from the root to a link, in that order.

        Args:
            link: its name.
        """
        path = []
        while link in self.carriers:
            path.append(self.carriers[link])
            link = path[-1].parent
        return path[::-1]

    def beyond(self, joint: str) -> list[str]:
        """The links that a joint carries, nearest first.

        Args:
            joint: its name.
        """
        found = [self.joints[joint].child]
        for link in found:
            found.extend(other.child for other in self.carried.get(link, ()))
        return found


def read_links(root: etree._Element) -> dict[str, Inertial | None]:
    """Every link's inertial, None where it has none.

    Raises:
        InputError: missing or duplicate names, malformed numbers, negative mass.
    """
    return _by_name(root, "link", _inertial)


def read_joints(root: etree._Element) -> dict[str, UrdfJoint]:
    """Every joint by name.

    Raises:
        InputError: missing or duplicate names, an unknown type, missing parents, children or
            limits, a zero axis, malformed numbers.
    """
    return _by_name(root, "joint", _joint)


def _by_name(
    root: etree._Element, tag: str, read: Callable[[etree._Element, str], T]
) -> dict[str, T]:
    found: dict[str, T] = {}
    for element in children(root, tag):
        name = element.get("name")
        if not name:
            raise InputError(f"a <{tag}> has no name (line {element.sourceline})")
        if name in found:
            raise InputError(f"two {tag}s have the same name", key=f"{tag} {name}")
        try:
            found[name] = read(element, name)
        except InputError as error:
            raise error.placed(key=f"{tag} {name}") from None
    return found


def _inertial(link: etree._Element, name: str) -> Inertial | None:
    found = children(link, "inertial")
    if not found:
        return None
    if len(found) > 1:
        raise InputError("has more than one <inertial>")
    mass, inertia = children(found[0], "mass"), children(found[0], "inertia")
    for tag, elements in (("mass", mass), ("inertia", inertia)):
        if len(elements) != 1:
            raise InputError(f"<inertial> needs one <{tag}>, it has {len(elements)}")
    value = _number(mass[0], "value")
    if value < 0:
        raise InputError("the mass is negative", value=value)
    tensor = tuple(_number(inertia[0], each) for each in INERTIA)
    return Inertial(value, *read_origin(found[0]), tensor)


def _joint(element: etree._Element, name: str) -> UrdfJoint:
    kind = element.get("type")
    if kind not in JOINT_TYPES:
        raise InputError("unknown joint type", value=kind, choices=JOINT_TYPES)
    axis: Vector = (1.0, 0.0, 0.0)
    if kind in MOVABLE and (found := children(element, "axis")):
        axis = _several(found[0], "xyz", axis)
        if not any(abs(part) > 1e-12 for part in axis):
            raise InputError("the axis has length zero", value=axis)
    xyz, rpy = read_origin(element)
    return UrdfJoint(name, kind, _end(element, "parent"), _end(element, "child"), xyz, rpy, axis,
                     *_limits(element, kind),
                     _mimic(element) if kind in MOVABLE else None)  # fmt: skip


def _limits(element: etree._Element, kind: str) -> tuple[float, float, float, float]:
    unlimited = float("inf")
    found = children(element, "limit")
    if kind not in MOVABLE or (kind == "continuous" and not found):
        return -unlimited, unlimited, unlimited, unlimited
    if not found:
        raise InputError(f"a {kind} joint needs <limit lower= upper= effort= velocity=>, "
                         "it has none")  # fmt: skip
    velocity = _number(found[0], "velocity", infinite=True)
    effort = _number(found[0], "effort", infinite=True)
    if effort < 0:
        raise InputError("the effort limit is negative", value=effort)
    if kind == "continuous":
        return -unlimited, unlimited, effort, velocity
    lower = _number(found[0], "lower", default=0.0, infinite=True)
    upper = _number(found[0], "upper", default=0.0, infinite=True)
    if lower > upper:
        raise InputError("the lower limit is above the upper limit", value=(lower, upper))
    return lower, upper, effort, velocity


def _mimic(element: etree._Element) -> Mimic | None:
    for found in children(element, "mimic"):
        return Mimic(
            found.get("joint") or "",
            _number(found, "multiplier", default=1.0),
            _number(found, "offset", default=0.0),
        )
    return None


def read_origin(element: etree._Element) -> tuple[Vector, Vector]:
    """Where an element's `<origin>` is, m, and how it is turned, roll, pitch and yaw in rad.

    Args:
        element: of the URDF; without an origin it is at zero.

    Raises:
        InputError: malformed numbers, two rotations, a quaternion that is none.
    """
    for found in children(element, "origin"):
        xyz, rpy = _several(found, "xyz", ZERO), _several(found, "rpy", ZERO)
        if found.get("quat_xyzw") is None:
            return xyz, rpy
        if found.get("rpy") is not None:
            raise InputError("<origin> has both rpy and quat_xyzw: one rotation is enough")
        four = np.array(_several(found, "quat_xyzw", (0.0,) * 4))
        length = float(np.linalg.norm(four))
        if abs(length - 1.0) > _UNIT_LENGTH:
            raise InputError(f"<origin quat_xyzw> is no rotation: its length is {length:.4g}, not "
                             "1", value=found.get("quat_xyzw"))  # fmt: skip
        matrix = pin.Quaternion(four / length).toRotationMatrix()
        roll, pitch, yaw = pin.rpy.matrixToRpy(matrix).tolist()
        return xyz, (roll, pitch, yaw)
    return ZERO, ZERO


def without_quaternions(root: etree._Element) -> str:
    """The URDF with roll, pitch and yaw in place of quaternions, for readers of URDF 1.0.

    Args:
        root: of the URDF; changed in place.

    Raises:
        InputError: as `read_origin`.
    """
    for element in root.iter("origin"):
        owner = element.getparent()
        if owner is not None and element.get("quat_xyzw") is not None:
            element.set("rpy", " ".join(map(repr, read_origin(owner)[1])))
            del element.attrib["quat_xyzw"]
    return etree.tostring(root, encoding="unicode")


def _end(element: etree._Element, tag: str) -> str:
    found = children(element, tag)
    link = found[0].get("link") if len(found) == 1 else None
    if not link:
        raise InputError(f'needs one <{tag} link="...">')
    return link


def to_number(text: str, *, infinite: bool = False) -> float:
    """A finite decimal number of sane size, with nothing else beside it.

    Args:
        text: what the file has.
        infinite: let "inf" and magnitudes above 1e12 stand, as limits may have them.

    Raises:
        ValueError: not a number, not finite, or above 1e12; the message says which.
    """
    stripped = text.strip()
    if infinite and _INFINITE.match(stripped):
        return float(stripped)
    if not _NUMBER.match(stripped):
        raise ValueError("is not a finite number")
    value = float(stripped)
    if infinite:
        return value
    if not math.isfinite(value) or abs(value) > LARGEST:
        raise ValueError(f"is larger than {LARGEST:g}")
    return value


def _number(
    element: etree._Element,
    attribute: str,
    *,
    default: float | None = None,
    infinite: bool = False,
) -> float:
    """A number from an attribute; one without a default must be there."""
    text = element.get(attribute)
    if text is None:
        if default is None:
            raise InputError(f"<{local_name(element)}> has no {attribute}")
        return default
    return _numbers(element, attribute, [text], infinite)[0]


def _several(element: etree._Element, attribute: str, default: Numbers) -> Numbers:
    """Numbers from an attribute, such as xyz or rpy: as many as the default has."""
    text = element.get(attribute)
    if text is None:
        return default
    parts = text.split()
    if len(parts) != len(default):
        raise InputError(f"<{local_name(element)} {attribute}> needs {_COUNTS[len(default)]} "
                         "numbers", value=text)  # fmt: skip
    return cast(Numbers, tuple(_numbers(element, attribute, parts)))


def _numbers(
    element: etree._Element, attribute: str, parts: list[str], infinite: bool = False
) -> list[float]:
    try:
        return [to_number(part, infinite=infinite) for part in parts]
    except ValueError as error:
        text = element.get(attribute, "")
        raise InputError(f"<{local_name(element)} {attribute}> {error}", value=text,
                         hint=EXPAND if "${" in text else None) from None  # fmt: skip
