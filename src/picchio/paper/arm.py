"""The paper's arm as printed, its poses in closed form, and the rivets it sets."""

from __future__ import annotations

import atexit
import dataclasses
import functools
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from picchio.core.arrays import FloatArray
from picchio.core.files import write_text
from picchio.paper.assumptions import Assumptions
from picchio.paper.printed import PrintedArm, printed
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.joint import Shaft
from picchio.robot.loading.load import load_robot

_folder = tempfile.TemporaryDirectory(prefix="picchio-paper-")
atexit.register(_folder.cleanup)


def arm(given: Assumptions) -> FlexibleRobot:
    """The arm of section 4.1 with assumed damping and shafts.

    Each shaft is the one that is the whole of its joint's spring (k = G Jp / l) and has the
    assumed stress per twist G r / l: r = (2 k / (pi G r / l))^(1/3).
    """
    robot = _bare_arm(given.inertia_about)
    joints = []
    for joint in robot.flexible_joints:
        radius = (2.0 * joint.stiffness / (np.pi * given.stress_per_twist)) ** (1.0 / 3.0)
        length = given.shear_modulus * radius / given.stress_per_twist
        joints.append(
            dataclasses.replace(
                joint,
                damping_ratio=given.damping_ratio,
                shaft=Shaft(radius=radius, length=length, shear_modulus=given.shear_modulus),
            )
        )
    return dataclasses.replace(robot, flexible_joints=tuple(joints))


@functools.cache
def _bare_arm(inertia_about: str) -> FlexibleRobot:
    path = Path(_folder.name) / f"paper_arm_{inertia_about}.urdf"
    write_text(path, urdf(printed().arm, inertia_about))
    return load_robot(path, tool="tool")


def urdf(values: PrintedArm, inertia_about: str = "cg") -> str:
    """The arm as URDF.

    Args:
        values: as printed.
        inertia_about: what Table 1's inertias are taken about: "cg" or "joint".
    """
    lines = ['<robot name="paper_arm" xmlns:picchio="urn:picchio:1"><link name="base"/>']
    place, parent = "0 0 0", "base"
    steps = ("0 0 {:.17g}", "{:.17g} 0 0", "{:.17g} 0 0")
    axes = ("0 0 1", "0 -1 0", "0 -1 0")
    for i in range(3):
        centre, (x, y, z) = values.centres_of_gravity[i], values.inertia(i, inertia_about)
        limit, name = values.limits[i], f"link_{i + 1}"
        lines.append(
            f'<joint name="joint_{i + 1}" type="revolute"><parent link="{parent}"/>'
            f'<child link="{name}"/><origin xyz="{place}"/><axis xyz="{axes[i]}"/>'
            f'<limit lower="{-limit:.17g}" upper="{limit:.17g}" '
            f'effort="{values.actuator_torques[i]:.17g}" velocity="1"/>'
            f'<picchio:flexibility stiffness="{values.stiffness[i]:.17g}" damping_ratio="0.03"/>'
            f'</joint><link name="{name}"><inertial>'
            f'<origin xyz="{" ".join(f"{c:.17g}" for c in centre)}"/>'
            f'<mass value="{values.masses[i]:.17g}"/><inertia ixx="{x:.17g}" iyy="{y:.17g}" '
            f'izz="{z:.17g}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        )
        place, parent = steps[i].format(values.link_lengths[i]), name
    lines.append(
        f'<joint name="tool_mount" type="fixed"><parent link="{parent}"/><child link="tool"/>'
        f'<origin xyz="{place}"/></joint><link name="tool"/></robot>'
    )
    return "\n".join(lines)


def poses_at(points: ArrayLike, elbow: str = "down") -> FloatArray:
    """Poses that put the tool on points; joint limits are ignored.

    Args:
        points: (..., 3) m.
        elbow: "down" (joint_3 lifts link 3: the elbow hangs below the line to the tool) or "up".

    Returns:
        (..., 3) rad; NaN out of reach.
    """
    x, y, z = np.moveaxis(np.asarray(points, dtype=float), -1, 0)
    l1, l2, l3 = printed().arm.link_lengths
    out, up = np.hypot(x, y), z - l1
    cosine = (out**2 + up**2 - l2**2 - l3**2) / (2.0 * l2 * l3)
    cosine = np.where(np.abs(cosine) > 1.0 + 1e-12, np.nan, np.clip(cosine, -1.0, 1.0))
    q3 = np.arccos(cosine) * (1.0 if elbow == "down" else -1.0)
    q2 = np.arctan2(up, out) - np.arctan2(l3 * np.sin(q3), l2 + l3 * np.cos(q3))
    return np.stack([np.arctan2(y, x), q2, q3], axis=-1)


def places_of(poses: ArrayLike) -> FloatArray:
    """Where the tool is, (..., 3) m, at poses (..., 3) rad."""
    q1, q2, q3 = np.moveaxis(np.asarray(poses, dtype=float), -1, 0)
    l1, l2, l3 = printed().arm.link_lengths
    out = l2 * np.cos(q2) + l3 * np.cos(q2 + q3)
    up = l1 + l2 * np.sin(q2) + l3 * np.sin(q2 + q3)
    return np.stack([out * np.cos(q1), out * np.sin(q1), up], axis=-1)


def rivet_points(given: Assumptions) -> FloatArray:
    """The rivet pattern of Fig. 12, as assumed: a panel that faces the robot.

    Returns:
        (k, 3) m, in the order of the path: row by row from the bottom, to and fro.
    """
    across = (np.arange(given.columns) - (given.columns - 1) / 2.0) * given.pitch
    up = (np.arange(given.rows) - (given.rows - 1) / 2.0) * given.pitch
    points = [
        (given.panel_x, given.panel_y + (a if row % 2 == 0 else -a), given.panel_z + b)
        for row, b in enumerate(up)
        for a in across
    ]
    return np.array(points)
