"""The masses of an arm whose URDF gives none: its probable total, spread along it.

Many makers' URDFs have shapes only. An arm's moving mass grows with its length, and tapers towards
the tool; both were fitted to the shipped robots, all of which have masses
(`python benchmarks/link_masses.py` does it again, and says how far off it is). A link is a rod from
its joint to the next one, thick enough to have inertia where two axes meet.

Stiffness and strength are then estimated from these masses, and their errors are common: where
the arm is heavier, it is stiffer and stronger, too. So the masses stand without a spread, and
stiffness and strength have the masses' as well.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.robot.dynamics.rigid_model import RigidModel
from picchio.robot.link import LinkEntry
from picchio.robot.masses.check import WAYS_OUT, weighs
from picchio.robot.spread import ESTIMATE
from picchio.robot.urdf.normalised import normalise
from picchio.robot.urdf.shapes import link_ends
from picchio.robot.urdf.tree import MOVABLE, ZERO, Inertial

if TYPE_CHECKING:
    from picchio.robot.flexible_robot import FlexibleRobot

# kg at a length of 1 m, and how it grows with the length; then how a link's mass per length grows
# with what is left of the arm beyond it, and how long a link of no length counts, over the arm's.
AT_ONE_METRE, GROWTH, TAPER, LEAST_LENGTH = 15.5, 3.0, 0.938, 0.469
SPREAD = 2.4
"""A factor: how far the inertias about joints of arms left out of the fit are off."""
_SHORTEST = 0.1
"""m from joint to joint: what is shorter is a gripper or a finger, far from all arms of the fit."""
_RADIUS = 0.04  # of gyration about a link's own axis, over the arm's length
_DIGITS = 3


def estimated_masses(robot: FlexibleRobot) -> dict[str, LinkEntry]:
    """Masses of the links that carry the tool, where no link that moves has any.

    Args:
        robot: it may be rigid.

    Returns:
        by link, as a sidecar has them; empty where the URDF or a sidecar gives masses, and where
        nothing has a length.

    Raises:
        InputError: the chain is far too short for an arm.
    """
    tree = robot.tree
    chain = tree.chain(robot.tool_frame)
    moving = [joint for joint in chain if joint.type in MOVABLE and joint.mimic is None]
    if not moving or any(weighs(robot, link) for link in tree.beyond(moving[0].name)):
        return {}
    ends = link_ends(tree, robot.tool_frame)
    lengths = np.linalg.norm(ends, axis=1)
    size = float(lengths.sum())
    if not size > 0.0:
        return {}
    if size < _SHORTEST:
        raise InputError(
            f"the URDF gives no masses, and {1e3 * size:.2g} mm from joint to joint are no arm "
            "whose masses could be estimated",
            key="link", hint=WAYS_OUT,
        )  # fmt: skip
    source = (
        f"estimated: the URDF gives no masses; arms of {size:.2g} m from joint to joint weigh "
        f"about {AT_ONE_METRE * size**GROWTH:.2g} kg, and taper"
    )
    return {
        joint.child: _rod(mass, end, _RADIUS * size, source)
        for joint, mass, end in zip(moving, masses(lengths), ends, strict=True)
    }


def weighted(robot: FlexibleRobot, links: Mapping[str, LinkEntry]) -> FlexibleRobot:
    """The robot with the masses.

    Args:
        robot: without.
        links: as of `estimated_masses`.

    Returns:
        the robot; as it was where there are none.
    """
    if not links:
        return robot
    bodies = {name: Inertial(one.mass or 0.0, one.com or ZERO, ZERO, one.inertia or (0.0,) * 6)
              for name, one in links.items()}  # fmt: skip
    tree = replace(robot.tree, links={**robot.tree.links, **bodies})
    text, point, _ = normalise(tree, robot.tool, robot.gun, robot.mounting)
    rigid = RigidModel(text, tree, robot.mounting.gravity)
    guessed = {f"link.{name}.mass": ESTIMATE for name in links}
    return replace(robot, tree=tree, rigid=rigid, tool_point=point,
                   origins={**robot.origins, **guessed})  # fmt: skip


def masses(lengths: FloatArray) -> FloatArray:
    """(n,) kg, of links from joint to joint, from the base to the tool.

    Args:
        lengths: (n,) m.
    """
    size = float(lengths.sum())
    beyond = np.cumsum(lengths[::-1])[::-1] - 0.5 * lengths + LEAST_LENGTH * size
    part = (lengths + LEAST_LENGTH * size) * beyond**TAPER
    return np.asarray(AT_ONE_METRE * size**GROWTH * part / part.sum())


def _rod(mass: float, end: FloatArray, radius: float, source: str) -> LinkEntry:
    """A rod from the link's origin to its end, of a radius of gyration about its own axis."""
    spread = (float(end @ end) * np.eye(3) - np.outer(end, end)) / 12.0
    inertia = mass * (spread + radius**2 * np.eye(3))
    six = (inertia[0, 0], inertia[0, 1], inertia[0, 2], inertia[1, 1], inertia[1, 2], inertia[2, 2])
    return LinkEntry(
        mass=_rounded(mass), com=tuple(_rounded(0.5 * float(part)) for part in end),
        inertia=tuple(_rounded(float(part)) for part in six), source=source,
    )  # fmt: skip


def _rounded(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}") + 0.0
