"""The URDF that Pinocchio gets: only the robot's tree, every default made explicit.

Only names, placements, axes and inertials are written. A continuous joint becomes a revolute
one, so that every movable joint has one number and nq = nv; joints of several degrees of
freedom are fixed at zero; the tool's mass, the gun and the mounting of the base join as
links of their own, so that they are counted once.
"""

from __future__ import annotations

from collections.abc import Iterable

from lxml import etree

from picchio.robot.joint import RECOIL_JOINT
from picchio.robot.tool import Gun, Mounting, Tool
from picchio.robot.urdf.tree import INERTIA, MOVABLE, ZERO, Inertial, UrdfTree, Vector


def normalise(
    tree: UrdfTree, tool: Tool, gun: Gun | None, mounting: Mounting
) -> tuple[str, str, str | None]:
    """The URDF for Pinocchio, the link at whose origin the force acts, the gun's joint or None."""
    robot = etree.Element("robot", name="robot")
    taken = {*tree.links, *tree.joints}

    def new(wish: str) -> str:
        """A name that the URDF does not use yet."""
        while wish in taken:
            wish += "_"
        taken.add(wish)
        return wish

    world = new("picchio_world")
    _link(robot, world, None)
    _joint(robot, new("picchio_mounting"), "fixed", world, tree.root, mounting.xyz,
           mounting.rpy)  # fmt: skip
    for link, inertial in tree.links.items():
        _link(robot, link, inertial)
    for joint in tree.joints.values():
        kind = "fixed" if joint.type not in MOVABLE else joint.type
        kind = "revolute" if kind == "continuous" else kind
        _joint(robot, joint.name, kind, joint.parent, joint.child, joint.xyz, joint.rpy,
               joint.axis)  # fmt: skip
    if tool.mass > 0:
        body = new("picchio_tool_body")
        _link(robot, body, Inertial(tool.mass, tool.com, ZERO, tool.inertia))
        _joint(robot, new("picchio_tool_mount"), "fixed", tool.frame, body, ZERO, ZERO)
    point = new("picchio_tool_point")
    gun_body = Inertial(gun.mass, ZERO, ZERO, (0.0,) * 6) if gun and gun.mass > 0 else None
    _link(robot, point, gun_body)
    if gun is None or gun.recoil_stiffness is None:
        _joint(robot, new("picchio_tool_offset"), "fixed", tool.frame, point, tool.xyz, ZERO)
        recoil = None
    else:
        recoil = new(RECOIL_JOINT)
        _joint(robot, recoil, "prismatic", tool.frame, point, tool.xyz, ZERO, tool.axis)
    return etree.tostring(robot, encoding="unicode"), point, recoil


def _link(robot: etree._Element, name: str, inertial: Inertial | None) -> None:
    link = etree.SubElement(robot, "link", name=name)
    if inertial is None:
        return
    element = etree.SubElement(link, "inertial")
    etree.SubElement(element, "origin", xyz=_text(inertial.xyz), rpy=_text(inertial.rpy))
    etree.SubElement(element, "mass", value=repr(inertial.mass))
    values = {name: repr(value) for name, value in zip(INERTIA, inertial.inertia, strict=True)}
    etree.SubElement(element, "inertia", values)


def _joint(
    robot: etree._Element,
    name: str,
    kind: str,
    parent: str,
    child: str,
    xyz: Vector,
    rpy: Vector,
    axis: Vector | None = None,
) -> None:
    joint = etree.SubElement(robot, "joint", name=name, type=kind)
    etree.SubElement(joint, "parent", link=parent)
    etree.SubElement(joint, "child", link=child)
    etree.SubElement(joint, "origin", xyz=_text(xyz), rpy=_text(rpy))
    if kind != "fixed":
        etree.SubElement(joint, "axis", xyz=_text(axis or (1.0, 0.0, 0.0)))
        # The limits that count are kept by the robot itself; Pinocchio only insists on some.
        etree.SubElement(joint, "limit", lower="-1e9", upper="1e9", effort="1", velocity="1")


def _text(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
