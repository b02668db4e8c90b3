"""Joints that carry no mass: found and named before any eigenvalue problem is solved."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.robot.urdf.check import bad_inertia

if TYPE_CHECKING:
    from picchio.robot.flexible_robot import FlexibleRobot

# Reflected inertia below this, kg m^2 (a 1 mg body at 1 mm has 1e-12), is none.
_LEAST_INERTIA = 1e-13
_LEAST_EIGENVALUE = 1e-9
# Snake arms have some 24; an assessment takes a minute at 30 and grows with the square and more.
_MOST_FLEXIBLE = 32
WAYS_OUT = (
    "give masses in the sidecar, [link.NAME] mass, com, inertia or [links] total_mass, or leave "
    "the joint rigid"
)


def check_masses(robot: FlexibleRobot) -> None:
    """Refuse a robot whose flexible joints do not all carry inertia.

    Args:
        robot: as it was loaded.

    Raises:
        InputError: too many; a body with an impossible inertia beyond a flexible joint; a flexible
            joint that carries no mass, or none off its axis; no mass but the tool's; a singular
            mass matrix.
    """
    file = robot.source
    check_count(robot, len(robot.flexible_joints))
    for joint in robot.flexible_joints:
        if joint.name not in robot.tree.joints:
            continue
        for link in robot.tree.beyond(joint.name):
            inertial = robot.tree.links[link]
            reason = bad_inertia(inertial) if inertial is not None else None
            if reason:
                raise InputError(f"cannot vibrate: {reason}", file=file, key=f"link {link}",
                                 hint=f"correct it, or leave {joint.name!r} rigid")  # fmt: skip
        _check_carried(robot, joint.name)
    _check_own_masses(robot)
    _check_mass_matrix(robot)


def check_count(robot: FlexibleRobot, joints: int) -> None:
    """Refuse more flexible joints than can be answered for in a minute or two.

    Args:
        robot: whose they are.
        joints: how many there are, or would be.

    Raises:
        InputError: there are more.
    """
    if joints > _MOST_FLEXIBLE:
        raise InputError(
            f"{joints} joints would be flexible, and at most {_MOST_FLEXIBLE} are solved together",
            file=robot.source, key="joint",
            hint="give a sidecar (--flex FILE) with the stiffness of those that yield most; the "
            "others stay rigid",
        )  # fmt: skip


def moving_links(robot: FlexibleRobot) -> list[str]:
    """The links that flexible joints of the URDF carry, in the URDF's order.

    Args:
        robot: as it was loaded.
    """
    joints = [joint.name for joint in robot.flexible_joints if joint.name in robot.tree.joints]
    carried = {link for joint in joints for link in robot.tree.beyond(joint)}
    return [link for link in robot.tree.links if link in carried]


def weighs(robot: FlexibleRobot, link: str) -> bool:
    """Whether a link has mass, or inertia, which some exporters write without it.

    Args:
        robot: as it was loaded.
        link: its name.
    """
    body = robot.tree.links[link]
    return body is not None and (body.mass > 0 or any(body.inertia))


def _check_carried(robot: FlexibleRobot, joint: str) -> None:
    links = robot.tree.beyond(joint)
    on_it = robot.tool.frame in links
    added = (robot.tool.mass + (robot.gun.mass if robot.gun else 0.0)) if on_it else 0.0
    if added > 0 or any(weighs(robot, link) for link in links):
        return
    raise InputError(f"joint {joint!r} is flexible but carries no mass", file=robot.source,
                     key=f"link {links[0]}", hint="give the link an <inertial>, give [tool] a "
                     "mass, or leave the joint rigid")  # fmt: skip


def _check_own_masses(robot: FlexibleRobot) -> None:
    """The tool's mass alone is no arm."""
    links = moving_links(robot)
    if len(links) > 1 and not any(weighs(robot, link) for link in links):
        some = ", ".join(links[:8]) + (" ..." if len(links) > 8 else "")
        raise InputError(f"no link that moves has a mass, only the tool has: {some}",
                         file=robot.source, key="link", hint=WAYS_OUT)  # fmt: skip


def general_pose(robot: FlexibleRobot) -> FloatArray:
    """A pose (nv,) within the limits that is nothing special, as zero often is.

    Args:
        robot: whose joints' limits count.
    """
    lower = np.where(np.isfinite(robot.lower), robot.lower, -np.pi)
    upper = np.where(np.isfinite(robot.upper), robot.upper, np.pi)
    part = 0.38 + 0.21 * np.sin(1.0 + np.arange(robot.rigid.nv))
    return np.asarray(lower + (upper - lower) * part)


def _check_mass_matrix(robot: FlexibleRobot) -> None:
    if not robot.flexible_joints:
        return
    pose = general_pose(robot)
    index = robot.flexible_index
    mass = robot.rigid.mass_matrix(pose)[np.ix_(index, index)]
    names = robot.flexible_names
    if not np.isfinite(mass).all():
        raise InputError("the mass matrix overflows: masses or lengths are absurdly large",
                         file=robot.source)  # fmt: skip
    diagonal = np.diag(mass)
    if (worst := int(diagonal.argmin())) >= 0 and diagonal[worst] < _LEAST_INERTIA:
        _refuse(robot, names[worst], f"has no inertia about its axis ({diagonal[worst]:.3g})")
    scale = 1.0 / np.sqrt(diagonal)
    values, vectors = np.linalg.eigh(mass * np.outer(scale, scale))
    if values[0] < _LEAST_EIGENVALUE:
        joint = names[int(np.abs(vectors[:, 0]).argmax())]
        _refuse(robot, joint, "makes the mass matrix singular")


def carrying(robot: FlexibleRobot, joints: Sequence[str]) -> list[str]:
    """Those of some joints that could be flexible together: every motion of them moves a mass.

    Args:
        robot: it may be rigid.
        joints: their names, from the base to the tool.

    Returns:
        what is left when one by one the joint that moves the least mass is taken out.
    """
    whole = robot.rigid.mass_matrix(general_pose(robot))
    names = [name for name in joints if _moves_mass(robot, name)]
    while names:
        index = [robot.joint_names.index(name) for name in names]
        mass = whole[np.ix_(index, index)]
        diagonal = np.diag(mass)
        worst = int(diagonal.argmin())
        if diagonal[worst] >= _LEAST_INERTIA:
            scale = 1.0 / np.sqrt(diagonal)
            values, vectors = np.linalg.eigh(mass * np.outer(scale, scale))
            if values[0] >= _LEAST_EIGENVALUE:
                break
            worst = int(np.abs(vectors[:, 0]).argmax())
        del names[worst]
    return names


def _moves_mass(robot: FlexibleRobot, joint: str) -> bool:
    links = robot.tree.beyond(joint)
    bodies = [body for link in links if (body := robot.tree.links[link]) is not None]
    return not any(bad_inertia(body) for body in bodies) and (
        (robot.tool.mass > 0.0 and robot.tool.frame in links)
        or any(weighs(robot, link) for link in links)
    )  # fmt: skip


def check_mass_at(robot: FlexibleRobot, pose: FloatArray, mass: FloatArray) -> None:
    """Refuse a pose at which some motion of the flexible joints moves no mass.

    Args:
        robot: whose pose it is.
        pose: (nv,) rad or m.
        mass: (n, n) the mass matrix there.

    Raises:
        InputError: the mass matrix is not positive definite, with pose, joint and a way out.
    """
    try:
        np.linalg.cholesky(mass)
    except np.linalg.LinAlgError:
        scale = 1.0 / np.sqrt(np.maximum(np.diag(mass), 1e-300))
        vectors = np.linalg.eigh(mass * np.outer(scale, scale))[1]
        joint = robot.flexible_names[int(np.abs(vectors[:, 0]).argmax())]
        at = ", ".join(f"{q:.4g}" for q in pose)
        _refuse(robot, joint, f"can move no mass at the pose ({at}): the mass matrix is not "
                "positive definite there")  # fmt: skip


def _refuse(robot: FlexibleRobot, joint: str, what: str) -> None:
    tree = robot.tree
    link = tree.joints[joint].child if joint in tree.joints else robot.tool.frame
    raise InputError(f"joint {joint!r} {what}", file=robot.source, key=f"link {link}",
                     hint=WAYS_OUT)  # fmt: skip
