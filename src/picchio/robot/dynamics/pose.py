"""Poses as users give them: checked, and compared with the joints' limits."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError, warn_user

if TYPE_CHECKING:
    from picchio.robot.flexible_robot import FlexibleRobot

# An angle of more than three turns either way is probably in degrees.
_TURNS = 3.0


def check_pose(robot: FlexibleRobot, values: Any) -> FloatArray:
    """A pose (nv,).

    Args:
        robot: whose joints and named poses count.
        values: a list in the order of `joint_names` or of `joint_names_given`, a mapping by joint
            name, or the name of a pose; joints not given are at zero.

    Raises:
        InputError: wrong length, unknown names, not finite numbers.
    """
    joint_names = robot.joint_names
    if (
        isinstance(values, np.ndarray)
        and values.shape == (len(joint_names),)
        and values.dtype == np.float64
        and np.isfinite(values).all()
    ):
        return values.copy() if values.flags.writeable else values
    if isinstance(values, str):
        if values not in robot.named_poses:
            raise InputError("the robot has no pose of this name", key="pose", value=values,
                             choices=robot.named_poses)  # fmt: skip
        return np.array(robot.named_poses[values])
    by_name = values if isinstance(values, Mapping) else _from_list(robot, values)
    pose = np.zeros(len(joint_names))
    for name, value in by_name.items():
        if name not in joint_names:
            raise InputError("the robot has no joint of this name", key="pose", value=name,
                             choices=joint_names)  # fmt: skip
        pose[joint_names.index(name)] = _finite(value, str(name))
    return pose


def _from_list(robot: FlexibleRobot, values: Any) -> dict[str, Any]:
    try:
        numbers = list(values)
    except TypeError:
        raise InputError("a pose is a list of numbers", key="pose", value=values) from None
    listed = robot.joint_names_given
    names = robot.joint_names if len(numbers) == len(robot.joint_names) else listed
    if len(numbers) != len(names):
        raise InputError(f"a pose of this robot has {len(listed)} numbers ({', '.join(listed)})",
                         key="pose", value=len(numbers))  # fmt: skip
    return dict(zip(names, numbers, strict=True))


def _finite(value: Any, joint: str) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = float("nan")
    if isinstance(value, (bool, str)) or not np.isfinite(number):
        raise InputError("is not a finite number", key=f"pose: {joint}", value=value)
    return number


def warn_beyond_limits(robot: FlexibleRobot, poses: Iterable[FloatArray], what: str) -> None:
    """Warn of every joint that is beyond its limits, and of angles that look like degrees.

    Such poses are allowed.

    Args:
        robot: whose limits count.
        poses: (nv,) each, rad or m.
        what: how to name them.
    """
    every = list(poses)
    beyond: dict[str, int] = {}
    for pose in every:
        for name in robot.limit_violations(pose):
            beyond[name] = beyond.get(name, 0) + 1
    far = max((float(np.abs(pose).max()) for pose in every if pose.size), default=0.0)
    hint = "; angles are in radians" if far > 2.0 * np.pi * _TURNS else ""
    for name, count in beyond.items():
        of = "" if len(every) == 1 else f" in {count} of {len(every)} poses"
        warn_user(f"{what}: {name} is beyond its limits{of}{hint}")
