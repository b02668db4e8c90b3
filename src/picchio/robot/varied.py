"""A robot with other values: what a spread leaves open, drawn."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from picchio.core.toml import StrictModel
from picchio.robot.dynamics.rigid_model import RigidModel
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.joint import Joint
from picchio.robot.spread import Number, Spread, root_of
from picchio.robot.urdf.normalised import normalise
from picchio.robot.urdf.tree import Inertial

# Of a joint, what its vibration depends on.
_SPRINGS = ("stiffness", "damping_ratio")
CASES = 64
"""Robots that are drawn where springs are estimates, for a band beside the most likely values."""


def robot_with(robot: FlexibleRobot, values: Iterable[tuple[Spread, Number]]) -> FlexibleRobot:
    """The robot with other values, known exactly: it has no spreads any more.

    A stiffness curve keeps its shape: all of it goes with the stiffness.

    Args:
        robot: as its files have it.
        values: spreads of it, and the value that each takes.
    """
    joints = {joint.name: joint for joint in robot.flexible_joints}
    mounted = {"tool": robot.tool, "gun": robot.gun, "base": robot.mounting}
    links = dict(robot.tree.links)
    moved = False
    for spread, value in values:
        if spread.table == "link":
            links[spread.owner] = _weighed(links[spread.owner], spread, value)
            moved = True
        elif spread.table == "joint":
            joint = joints[spread.owner]
            joints[spread.owner] = _changed(joint, spread.path, value, spread.component)
        else:
            record = mounted[spread.table]
            mounted[spread.table] = _changed(record, spread.path, value, spread.component)
            moved = True
    changes: dict[str, Any] = {"spreads": {}, "posterior": None, "again": None}
    if moved:
        tool, gun, mounting = mounted["tool"], mounted["gun"], mounted["base"]
        tree = replace(robot.tree, links=links)
        text, point, recoil = normalise(tree, tool, gun, mounting)  # type: ignore[arg-type]
        rigid = RigidModel(text, tree, mounting.gravity)  # type: ignore[union-attr]
        if recoil is not None:
            joints[recoil] = replace(joints[recoil], stiffness=gun.recoil_stiffness,  # type: ignore
                                     damping_ratio=gun.damping_ratio)  # type: ignore # fmt: skip
        changes |= {"tree": tree, "tool": tool, "gun": gun, "mounting": mounting, "rigid": rigid,
                    "tool_point": point}  # fmt: skip
    names = [joint.name for joint in robot.flexible_joints]
    return replace(robot, flexible_joints=tuple(joints[name] for name in names), **changes)


def springs_of(robot: FlexibleRobot) -> list[Spread]:
    """What of a robot's joints is uncertain that its vibration depends on.

    Args:
        robot: whose values may have spreads.
    """
    return [one for one in robot.spreads.values()
            if one.table == "joint" and one.path[0] in _SPRINGS]  # fmt: skip


def drawn_robots(robot: FlexibleRobot, count: int, seed: int = 0) -> Iterator[FlexibleRobot]:
    """Robots whose joints' values are drawn from their spreads, correlated as the posterior says.

    Args:
        robot: whose values have spreads; what its drives bear stays as it is.
        count: how many.
        seed: of the draws.

    Yields:
        each, its values known exactly.
    """
    spreads = springs_of(robot)
    root = root_of([one.name for one in spreads], robot.posterior)
    for row in np.random.default_rng(seed).standard_normal((count, len(spreads))) @ root:
        values = [(one, one.at(float(score))) for one, score in zip(spreads, row, strict=True)]
        yield robot_with(robot, values)


def cases_of(robot: FlexibleRobot) -> Iterator[FlexibleRobot]:
    """`CASES` drawn robots where a stiffness or damping is an estimate; else none.

    Args:
        robot: whose values may have spreads.

    Yields:
        each, its values known exactly; always the same ones.
    """
    if any(one.estimated for one in springs_of(robot)):
        yield from drawn_robots(robot, CASES)


def _weighed(body: Inertial | None, spread: Spread, value: Any) -> Inertial:
    """A link's inertial with another mass (and inertia, in proportion), centre or inertia."""
    assert body is not None
    key, k = spread.path[0], spread.component
    if key == "mass":
        factor = value / body.mass if body.mass > 0.0 else 0.0
        return replace(body, mass=value, inertia=tuple(factor * part for part in body.inertia))
    now: Any = body.xyz if key == "com" else body.inertia
    new = value if k is None else (*now[:k], value[k], *now[k + 1 :])
    return replace(body, xyz=new) if key == "com" else replace(body, inertia=new)


def _changed(record: Any, path: tuple[str, ...], value: Any, component: int | None) -> Any:
    """A record with the value at a path changed; of a vector only one component, if given."""
    key, *rest = path
    now = getattr(record, key)
    if rest:
        value = _changed(now, tuple(rest), value, component)
    elif component is not None:
        value = (*now[:component], value[component], *now[component + 1 :])
    if isinstance(record, StrictModel):
        return record.model_copy(update={key: value})
    if isinstance(record, Joint) and key == "stiffness" and record.stiffness_curve is not None:
        curve, factor = record.stiffness_curve, value / record.stiffness
        scaled = {name: factor * getattr(curve, name) for name in ("k1", "k2", "k3")}
        return replace(record, stiffness=value, stiffness_curve=curve.model_copy(update=scaled))
    return replace(record, **{key: value})
