"""The blows that a study takes where none are given: those of the robot's example task."""

from __future__ import annotations

import math
from pathlib import Path

from picchio.core.errors import InputError
from picchio.core.toml import parse_toml
from picchio.excitation.excitation import Excitation
from picchio.excitation.table import ExcitationTable, excitation_class
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.studies.tasks import FORMAT, TaskTable


def blows_of(
    robot: FlexibleRobot,
    task: str | Path | None = None,
    *,
    force: float | None = None,
    period: float | None = None,
    width: float | None = None,
) -> Excitation:
    """The blows of a task, with some of their numbers changed.

    Args:
        robot: its example task fills in what is not given.
        task: another task file to fill it in.
        force: N, height of a blow.
        period: s, from one blow to the next.
        width: s, of a blow.

    Raises:
        InputError: a number that is not positive and finite, or one that is not given anywhere.
    """
    file = task or robot.task_path
    table = ExcitationTable()
    if file is not None:
        table = parse_toml(file, TaskTable, format=FORMAT).excitation
    given = {"force": force, "period": period, "width": width}
    for key, value in given.items():
        if value is not None:
            if not math.isfinite(value):
                raise InputError("must be a finite number", key=key, value=value)
            if value <= 0.0:
                raise InputError("must be positive", key=key, value=value)
            table = table.overridden_by(ExcitationTable(**{key: value}))  # type: ignore[arg-type]
        elif getattr(table, key) is None and key in excitation_class(table.kind).needed:
            raise InputError(
                f"{robot.name} has no example task that gives it", key=key, hint="give it"
            )
    try:
        return table.build(file=file)
    except InputError as error:
        key = (error.key or "").rpartition(".")[2]
        if given.get(key) is None:
            raise
        raise InputError(error.problem, key=key, value=error.value) from None


def hits_of_rivet(robot: FlexibleRobot) -> int:
    """The blows that a rivet takes on the robot's example task.

    Args:
        robot: one without an example task takes as many as a task that does not say.
    """
    if robot.task_path is None:
        return TaskTable.model_fields["hits_per_rivet"].get_default()  # type: ignore[no-any-return]
    return parse_toml(robot.task_path, TaskTable, format=FORMAT).hits_per_rivet
