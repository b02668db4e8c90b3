"""What a diagnosis found, as a sidecar: ready for `picchio assess --flex`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from picchio.core.errors import InputError
from picchio.diagnosis.result import Cause, Diagnosis, Value
from picchio.robot.annotations.sidecar import FORMAT
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.joint import Joint
from picchio.robot.tool import Mounting


def identified_sidecar(
    robot: FlexibleRobot, diagnosis: Diagnosis, source: str
) -> tuple[dict[str, Any], list[str]]:
    """The robot's sidecar with the values that were found in it.

    Stiffnesses, rotor inertias (of joints whose gear ratio is known) and the tool's mass are put
    in with their uncertainty; everything else of the joints stays as it was. What a sidecar has
    no place for (friction, ripple, delays) is returned as lines for people.

    Args:
        robot: as it was diagnosed.
        diagnosis: its causes.
        source: where the data are from, such as the campaign's name.

    Returns:
        the sidecar as plain tables, and remarks.
    """
    if not diagnosis.causes:
        raise InputError(f"the diagnosis is {diagnosis.verdict!r}: there is nothing to write")
    joints = {joint.name: _joint(robot, joint) for joint in robot.flexible_joints}
    table: dict[str, Any] = {"format": FORMAT, "description": f"{robot.name}, identified"}
    remarks: list[str] = []
    tool = _tool(robot)
    for cause in diagnosis.causes:
        if cause.effect == "joint_stiffness" and cause.target in joints:
            value = _stiffness(robot, cause)
            entry = joints[cause.target]
            entry.pop("stiffness_curve", None)
            entry.pop("estimated", None)
            entry |= {"stiffness": value.value, "source": _said(source, "stiffness", value)}
        elif cause.effect == "joint_inertia" and _ratio(robot, cause.target):
            ratio = _ratio(robot, cause.target)
            value = cause.parameters["inertia"]
            joints[cause.target]["rotor_inertia"] = max(value.value, 0.0) / ratio**2
            remarks.append(_remark(cause) + f" (written as rotor_inertia, over {ratio:g}^2)")
        elif cause.effect == "payload" and tool["mass"] + cause.parameters["mass"].value >= 0.0:
            value = cause.parameters["mass"]
            tool["mass"] += value.value
            tool["source"] = _said(source, "mass", value)
        else:
            remarks.append(_remark(cause))
    for name, value in diagnosis.nuisances.items():
        if name.startswith("stiffness.") and name.partition(".")[2] in joints:
            entry = joints[name.partition(".")[2]]
            if "stiffness" in entry:
                entry |= {"stiffness": value.value, "source": _said(source, "stiffness", value)}
        else:
            remarks.append(f"{name} = {_number(value)}")
    table["joint"] = joints
    table["tool"] = tool
    table |= _standing(robot)
    return table, remarks


def _joint(robot: FlexibleRobot, joint: Joint) -> dict[str, Any]:
    """A joint as it is now, with where its stiffness is from."""
    from dataclasses import asdict

    found: dict[str, Any] = {"stiffness": joint.stiffness, "damping_ratio": joint.damping_ratio}
    if joint.stiffness_curve is not None:
        del found["stiffness"]
        found["stiffness_curve"] = asdict(joint.stiffness_curve)
    for key in ("reducer", "rotor_inertia", "gear_ratio"):
        if (value := getattr(joint, key)) is not None:
            found[key] = value
    for key in ("shaft", "balancer"):
        if (value := getattr(joint, key)) is not None:
            found[key] = {k: v for k, v in asdict(value).items() if v is not None}
    if joint.estimated:
        found["estimated"] = True
    origin = robot.origins.get(f"{joint.name}.stiffness")
    if origin:
        found["source"] = origin
    return found


def _tool(robot: FlexibleRobot) -> dict[str, Any]:
    tool = robot.tool
    found: dict[str, Any] = {"frame": tool.frame, "xyz": list(tool.xyz), "axis": list(tool.axis),
                             "mass": tool.mass}  # fmt: skip
    if tool.mass > 0.0:
        found |= {"com": list(tool.com), "inertia": list(tool.inertia)}
    return found


def _standing(robot: FlexibleRobot) -> dict[str, Any]:
    """Gun and mounting, where they are not the usual."""
    from dataclasses import asdict

    found: dict[str, Any] = {}
    if robot.gun is not None:
        found["gun"] = {k: v for k, v in asdict(robot.gun).items() if v is not None}
    if robot.mounting != Mounting():
        found["base"] = {k: list(v) for k, v in asdict(robot.mounting).items()}
    return found


def _ratio(robot: FlexibleRobot, joint: str) -> float:
    found = {j.name: j.gear_ratio for j in robot.flexible_joints}
    return abs(found.get(joint) or 0.0)


def _stiffness(robot: FlexibleRobot, cause: Cause) -> Value:
    if "stiffness" in cause.parameters:
        return cause.parameters["stiffness"]
    scale = cause.parameters["scale"]
    nominal = {j.name: j.stiffness for j in robot.flexible_joints}[cause.target]
    return Value(scale.value * nominal, scale.std * nominal, "N*m/rad")


def _said(source: str, what: str, value: Value) -> str:
    return f"picchio identify on {source}: {what} {_number(value)}"


def _number(value: Value) -> str:
    return f"{value.value:.5g} +- {value.std:.2g} {value.unit}"


def _remark(cause: Cause) -> str:
    numbers: Mapping[str, Value] = cause.parameters
    text = ", ".join(f"{name} {_number(value)}" for name, value in numbers.items())
    return f"{cause.effect} of {cause.target}: {text}"
