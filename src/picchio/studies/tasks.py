"""A riveting task: operations, each a direction, a blow train and the poses it is done in."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from pydantic import Field

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError, warn_user
from picchio.core.shown import Shown
from picchio.core.toml import Finite, Positive, StrictModel, parse_toml, validate
from picchio.excitation.excitation import Excitation
from picchio.excitation.piecewise import Hits
from picchio.excitation.pulse_train import USUAL_BLOWS, USUAL_HITS
from picchio.excitation.table import ExcitationTable, excitation_class
from picchio.model.model import Model, ModelLike
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.vibration.closed_form.response import unit_vector

if TYPE_CHECKING:
    import pandas

FORMAT = "picchio-task/1"
ASSUMED_BLOWS = ExcitationTable(**USUAL_BLOWS.to_dict())
# An arm of fewer joints cannot choose where its tool points.
_LEAST_JOINTS_TO_AIM = 5


class OperationTable(ExcitationTable):
    """One `[[operation]]`: rivets in one direction; its blows as in `[excitation]`.

    Attributes:
        name: unique within the task.
        direction: world; the tool's force on the robot acts along it. Any length.
        poses: rad or m, one list a pose in the robot's joint order, or a table by joint name;
            joints left out are at zero. Give poses or points.
        points: m, world; inverse kinematics finds the poses, the tool pointing against the
            direction where the arm can aim.
        branch: which solution of the inverse kinematics: "any", "elbow-up" or "elbow-down"
            (3 joints), or a list of words for the signs of joints (6 and 7 joints).
        rivets: 1, rivets at each pose in one pass of the task.
        hits_per_rivet: blows a rivet takes; overrides the task's.
        excitation: keys that override the task's `[excitation]`.
    """

    name: str
    direction: list[Finite]
    poses: list[list[Finite] | dict[str, Finite]] | None = None
    points: list[list[Finite]] | None = None
    branch: str | list[str] = "any"
    rivets: Positive = 1.0
    hits_per_rivet: Hits | None = None
    excitation: ExcitationTable | None = None

    def own_excitation(self) -> ExcitationTable:
        """The excitation's keys given here, in a table of their own or flat."""
        own = OperationTable.__annotations__
        flat = {name: value for name, value in self.given().items() if name not in own}
        return (self.excitation or ExcitationTable()).overridden_by(ExcitationTable(**flat))


class TaskTable(StrictModel):
    """A task file as it is written.

    Attributes:
        hits_per_rivet: blows a rivet takes.
        excitation: the blows; an operation may override any key.
        operation: rivets in one direction, one table for each.
    """

    hits_per_rivet: Hits = USUAL_HITS
    excitation: ExcitationTable = ExcitationTable()
    operation: list[OperationTable] = Field(min_length=1)


@dataclass(frozen=True, eq=False)
class Operation:
    """Riveting in one direction at some poses.

    Attributes:
        name: for the reader.
        direction: (3,) unit vector, world: where the tool's force pushes the robot.
        excitation: the blows.
        hits_per_rivet: blows a rivet takes.
        poses: (n_poses, nv) rad or m.
        rivets: at each pose, per pass of the task.
    """

    name: str
    direction: FloatArray
    excitation: Excitation
    hits_per_rivet: int
    poses: FloatArray
    rivets: float = 1.0


@dataclass(frozen=True, eq=False)
class Task(Shown):
    """All that a robot does before it starts again.

    Attributes:
        operations: in the order of the file.
        files: every file read, for provenance.
        note: what it is, where nobody gave one; else "".
        assumed: nobody gave it: it is the robot's example, or drawn.
    """

    LACKS: ClassVar = {"plot": "assess it", "show": "`picchio.view(robot, task=task)` shows it"}

    operations: tuple[Operation, ...]
    files: tuple[Path, ...] = ()
    note: str = ""
    assumed: bool = False

    def __repr__(self) -> str:
        names = [op.name for op in self.operations]
        return f"Task(operations={names}, rivets_per_pass={self.rivets_per_pass:g})"

    def _repr_html_(self) -> str:
        from picchio.core.html import sheet

        rows = [
            (op.name, op.direction, len(op.poses), op.rivets, op.hits_per_rivet,
             op.excitation.describe())
            for op in self.operations
        ]  # fmt: skip
        columns = ("operation", "force along", "poses", "rivets a pose", "hits a rivet", "blows")
        title = f"Task: {self.rivets_per_pass:g} rivets a pass"
        return sheet(title, None, columns, rows, head=self.note)

    def to_frame(self) -> pandas.DataFrame:
        """A row an operation."""
        import pandas

        return pandas.DataFrame(
            [
                {
                    "operation": op.name,
                    "direction": op.direction.tolist(),
                    "poses": len(op.poses),
                    "rivets": op.rivets,
                    "hits_per_rivet": op.hits_per_rivet,
                    "blows": op.excitation.describe(),
                }
                for op in self.operations
            ]
        ).set_index("operation")

    def with_blows(self, excitation: Excitation) -> Task:
        """The same task with other blows in every operation.

        Args:
            excitation: the blows.
        """
        changed = tuple(replace(op, excitation=excitation) for op in self.operations)
        return replace(self, operations=changed)

    @property
    def rivets_per_pass(self) -> float:
        """Rivets set in one pass of the task."""
        return sum(op.rivets * len(op.poses) for op in self.operations)


def load_task(path: str | Path, robot: ModelLike) -> Task:
    """Read a `picchio-task/1` file for a robot; points become poses.

    Args:
        path: the file.
        robot: that does the task, as `load_robot` takes it.

    Returns:
        the task.

    Raises:
        InputError: anything wrong in the file, with its key; an unreachable point.
    """
    table = parse_toml(path, TaskTable, format=FORMAT)
    return _build(table, Model.of(robot).robot, Path(path))


def task_from_dict(data: Mapping[str, Any], robot: ModelLike) -> Task:
    """The task that a file with this content would give.

    Args:
        data: keys and values of the file; `format` may be left out.
        robot: that does the task.

    Raises:
        InputError: as `load_task`.
    """
    content = {"format": FORMAT, **data}
    table = validate(content, TaskTable, format=FORMAT)
    return _build(table, Model.of(robot).robot, None)


def _build(table: TaskTable, robot: FlexibleRobot, file: Path | None) -> Task:
    operations = []
    reached: dict[tuple[object, ...], FloatArray] = {}
    files = [file] if file is not None else []
    names: set[str] = set()
    for k, entry in enumerate(table.operation):
        key = f"operation[{k}]"
        if entry.name in names:
            raise InputError("names two operations", file=file, key=f"{key}.name", value=entry.name)
        names.add(entry.name)
        merged = table.excitation.overridden_by(entry.own_excitation())
        if merged.preload is None and robot.gun is not None and robot.gun.feed_force:
            merged = merged.overridden_by(ExcitationTable(preload=robot.gun.feed_force))
        own = entry.own_excitation() != ExcitationTable()
        excitation = merged.build(file=file, key=key if own else "excitation")
        if merged.file is not None and file is not None:
            files.append(file.parent / merged.file)
        try:
            direction = unit_vector(entry.direction)
        except InputError as error:
            raise InputError(
                error.problem, file=file, key=f"{key}.direction", value=entry.direction
            ) from None
        operations.append(
            Operation(
                entry.name,
                direction,
                excitation,
                entry.hits_per_rivet or table.hits_per_rivet,
                _poses(entry, robot, direction, reached, file, key),
                entry.rivets,
            )
        )
    return Task(tuple(operations), tuple(files))


def _poses(
    entry: OperationTable,
    robot: FlexibleRobot,
    direction: FloatArray,
    reached: dict[tuple[object, ...], FloatArray],
    file: Path | None,
    key: str,
) -> FloatArray:
    if entry.poses is None and entry.points is None:
        raise InputError("needs poses or points", file=file, key=key)
    if entry.poses is not None and entry.points is not None:
        raise InputError("has both poses and points; give one", file=file, key=key)
    if entry.poses is not None and "branch" in entry.model_fields_set:
        raise InputError("chooses how points are reached; poses stand as they are", file=file,
                         key=f"{key}.branch")  # fmt: skip
    given: list[Any] = (entry.poses if entry.poses is not None else entry.points) or []
    what = "poses" if entry.poses is not None else "points"
    if not given:
        raise InputError("is empty", file=file, key=f"{key}.{what}")
    poses = []
    for i, value in enumerate(given):
        here = f"{key}.{what}[{i}]"
        try:
            if what == "poses":
                pose = robot.pose(value)
            else:
                if len(value) != 3:
                    raise InputError("a point has three coordinates in metres")
                # Tasks repeat their points from operation to operation; each is solved once.
                aim = None if len(robot.joint_names) < _LEAST_JOINTS_TO_AIM else -direction
                known = (*value, str(aim), str(entry.branch))
                if known not in reached:
                    reached[known] = robot.inverse_kinematics(value, axis=aim, branch=entry.branch)
                pose = reached[known]
        except InputError as error:
            if error.key == "branch":
                here, value = f"{key}.branch", error.value
            raise InputError(
                error.problem, file=file, key=here, value=value, choices=error.choices,
                hint=error.hint,
            ) from None  # fmt: skip
        poses.append(pose)
    return np.array(poses)


def blows_of(
    robot: FlexibleRobot,
    task: str | Path | None = None,
    *,
    force: float | None = None,
    period: float | None = None,
    width: float | None = None,
) -> Excitation:
    """The blows of a study that has no task of its own: a task's, some of their numbers changed.

    Args:
        robot: its example task fills in what is not given; without one, `ASSUMED_BLOWS`, with a
            warning.
        task: another task file to fill it in.
        force: N, peak force of one blow.
        period: s, from one blow to the next.
        width: s, of a blow.

    Raises:
        InputError: a number that is not positive and finite, or one that is not given anywhere.
    """
    file = task or robot.task_path
    given = {"force": force, "period": period, "width": width}
    if file is not None:
        table = parse_toml(file, TaskTable, format=FORMAT).excitation
    else:
        table = ASSUMED_BLOWS
        assumed = [f"{key} {getattr(table, key):g} {unit}" for key, unit in
                   zip(given, ("N", "s", "s"), strict=True) if given[key] is None]  # fmt: skip
        if assumed:
            warn_user(f"{robot.name} has no task of its own: of the blows, {', '.join(assumed)} "
                      "are assumed")  # fmt: skip
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
