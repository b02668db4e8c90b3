"""What options name, read and filled up from the robot's example task."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from picchio.core.errors import InputError

if TYPE_CHECKING:
    from picchio.robot.flexible_robot import FlexibleRobot


def numbers(text: str, key: str, count: int | None = None) -> list[float]:
    """Numbers separated by commas.

    Args:
        text: as given.
        key: the option, for the message.
        count: how many there must be; any number if not given.

    Raises:
        InputError: something that is no number, or not as many as there must be.
    """
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError("must be numbers separated by commas", key=key, value=text) from None
    if count is not None and len(values) != count:
        raise InputError(f"must be {count} numbers", key=key, value=text)
    return values


def task_file(robot: FlexibleRobot, task: Path | None) -> Path:
    """The task that was given, or else the robot's example.

    Raises:
        InputError: neither.
    """
    path = task or robot.task_path
    if path is None:
        raise InputError(
            f"{robot.name} has no example task of its own",
            key="--task",
            hint="give one: a TOML file of the format picchio-task/1",
        )
    return path
