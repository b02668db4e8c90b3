"""A robot as the tables of a sidecar: what a new sidecar keeps of the old values."""

from __future__ import annotations

import math
from typing import Any

from picchio.core.toml import StrictModel
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.joint import Joint
from picchio.robot.spread import ESTIMATED
from picchio.robot.tool import Mounting


def tool_entry(robot: FlexibleRobot) -> dict[str, Any]:
    """The tool's table.

    Args:
        robot: whose it is.
    """
    # Without a mass there is neither its centre nor an inertia.
    left_out = {"source"} if robot.tool.mass > 0.0 else {"source", "com", "inertia"}
    return robot.tool.model_dump(mode="json", exclude=left_out, exclude_none=True)


def joint_entry(robot: FlexibleRobot, joint: Joint) -> dict[str, Any]:
    """A joint's table as it is now, with where its stiffness is from.

    Args:
        robot: whose it is.
        joint: flexible.
    """
    found: dict[str, Any] = {"stiffness": joint.stiffness, "damping_ratio": joint.damping_ratio}
    if joint.stiffness_curve is not None:
        del found["stiffness"]
    for key in ("stiffness_curve", "rotor_inertia", "gear_ratio", "shaft", "strength", "balancer"):
        if (value := getattr(joint, key)) is not None:
            model = isinstance(value, StrictModel)
            found[key] = value.model_dump(exclude_none=True) if model else value
    if joint.reducer is not None:
        found["reducer"] = joint.reducer.name
    if joint.estimated:
        found["estimated"] = True
    for spread in robot.spreads.values():
        if spread.table == "joint" and spread.owner == joint.name and len(spread.path) == 1:
            usual = spread.estimated and math.isclose(spread.size, math.log(ESTIMATED))
            found |= {} if usual else {f"{spread.path[0]}_spread": math.exp(spread.size)}
    if joint.estimated:  # not of values that are no estimates, whatever source they are from
        sure = [key for key in ("stiffness", "damping_ratio") if key in found
                and f"{key}.{joint.name}" not in robot.spreads]  # fmt: skip
        found |= {f"{key}_spread": 1.0 for key in sure}
    origin = robot.origins.get(f"{joint.name}.stiffness")
    if origin:
        found["source"] = origin
    return found


def standing_entries(robot: FlexibleRobot) -> dict[str, Any]:
    """The tables of gun and mounting, where they are not the usual.

    Args:
        robot: whose they are.
    """
    found: dict[str, Any] = {}
    if robot.gun is not None:
        found["gun"] = robot.gun.model_dump(exclude_none=True)
    if robot.mounting != Mounting():
        found["base"] = robot.mounting.model_dump(exclude_none=True)
    return found
