"""What options name, read and filled up from the robot's example task."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from picchio.core.errors import InputError

if TYPE_CHECKING:
    from picchio.excitation.excitation import Excitation
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


def choose_blows(
    robot: FlexibleRobot,
    force: float | None,
    period: float | None,
    width: float | None,
    task: Path | None = None,
) -> Excitation:
    """The blows of the command line, filled up from the robot's example task.

    Raises:
        InputError: neither the command line nor a task gives them.
    """
    from picchio.cli.output import check_numbers
    from picchio.core.toml import parse_toml
    from picchio.excitation.table import ExcitationTable, excitation_class
    from picchio.studies.tasks import FORMAT, TaskTable

    check_numbers(force=force, period=period, width=width)
    file = task or robot.task_path
    table = ExcitationTable()
    if file is not None:
        table = parse_toml(file, TaskTable, format=FORMAT).excitation
    given: dict[str, Any] = {"force": force, "period": period, "width": width}
    for key, value in given.items():
        if value is not None:
            if not value > 0:
                raise InputError("must be positive", key=f"--{key}", value=value)
            table = table.overridden_by(ExcitationTable(**{key: value}))
        elif getattr(table, key) is None and key in excitation_class(table.kind).needed:
            raise InputError(
                f"{robot.name} has no example task that gives it", key=f"--{key}", hint="give it"
            )
    try:
        return table.build(file=file)
    except InputError as error:
        key = (error.key or "").rpartition(".")[2]
        if given.get(key) is None:
            raise
        raise InputError(error.problem, key=f"--{key}", value=error.value) from None
