"""Joints that carry no mass: found and named before any eigenvalue problem is solved."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from picchio.core.errors import InputError
from picchio.robot.urdf.check import bad_inertia

if TYPE_CHECKING:
    from picchio.robot.flexible_robot import FlexibleRobot

# Reflected inertia below this, kg m^2 (a 1 mg body at 1 mm has 1e-12), is none.
_LEAST_INERTIA = 1e-13
_LEAST_EIGENVALUE = 1e-9


def check_masses(robot: FlexibleRobot) -> None:
    """Refuse a robot whose flexible joints do not all carry inertia.

    Args:
        robot: as it was loaded.

    Raises:
        InputError: a body with an impossible inertia beyond a flexible joint; a flexible joint
            that carries no mass, or none off its axis; a singular mass matrix.
    """
    file = robot.source
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
    _check_mass_matrix(robot)


def _check_carried(robot: FlexibleRobot, joint: str) -> None:
    links = robot.tree.beyond(joint)
    bodies = [robot.tree.links[link] for link in links]
    on_it = robot.tool.frame in links
    added = (robot.tool.mass + (robot.gun.mass if robot.gun else 0.0)) if on_it else 0.0
    if added > 0 or any(body is not None and body.mass > 0 for body in bodies):
        return
    # Mass without weight is written by some exporters: inertia alone does for a rotation.
    if any(body is not None and any(body.inertia) for body in bodies):
        return
    raise InputError(f"joint {joint!r} is flexible but carries no mass", file=robot.source,
                     key=f"link {links[0]}", hint="give the link an <inertial>, give [tool] a "
                     "mass, or leave the joint rigid")  # fmt: skip


def _check_mass_matrix(robot: FlexibleRobot) -> None:
    if not robot.flexible_joints:
        return
    lower = np.where(np.isfinite(robot.lower), robot.lower, -np.pi)
    upper = np.where(np.isfinite(robot.upper), robot.upper, np.pi)
    # Zero is often a special pose: a general one within the limits tells structure from chance.
    general = lower + (upper - lower) * (0.38 + 0.21 * np.sin(1.0 + np.arange(robot.rigid.nv)))
    mass = robot.mass_and_jacobian(general[None])[0][0]
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


def _refuse(robot: FlexibleRobot, joint: str, what: str) -> None:
    tree = robot.tree
    link = tree.joints[joint].child if joint in tree.joints else robot.tool.frame
    raise InputError(
        f"joint {joint!r} {what}",
        file=robot.source,
        key=f"link {link}",
        hint="give the link and what it carries their inertias, or leave the joint rigid",
    )
