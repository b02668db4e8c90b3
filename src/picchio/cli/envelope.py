"""`picchio envelope`: what a force can do to each joint at a pose, by its direction."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from picchio.cli.options import (
    FlexOption,
    GravityStiffnessOption,
    JsonOption,
    RobotArgument,
    ToolOption,
)
from picchio.core.errors import InputError

if TYPE_CHECKING:
    from picchio.excitation import Excitation
    from picchio.robot import FlexibleRobot
    from picchio.studies.envelope import DirectionEnvelope

EPILOG = "Example: picchio envelope fanuc_like_3dof --pose=0.3,1.1,-1.0"

PoseOption = Annotated[
    str, typer.Option("--pose", metavar="Q1,Q2,...", help="Joint positions, rad or m.")
]
ForceOption = Annotated[
    float | None, typer.Option(help="N, height of a blow; the example task's if not given.")
]
PeriodOption = Annotated[float | None, typer.Option(help="s, from one blow to the next.")]
WidthOption = Annotated[float | None, typer.Option(help="s, width of a blow.")]


def register(app: typer.Typer) -> None:
    """Add the subcommand."""
    app.command(epilog=EPILOG)(envelope)


def envelope(
    robot: RobotArgument,
    pose: PoseOption,
    force: ForceOption = None,
    period: PeriodOption = None,
    width: WidthOption = None,
    hits: Annotated[
        int | None, typer.Option(help="Blows of a burst from rest; steady state if not given.")
    ] = None,
    flex: FlexOption = None,
    tool: ToolOption = None,
    gravity_stiffness: GravityStiffnessOption = False,
    json: JsonOption = None,
) -> None:
    """The worst force direction of every joint at a pose, exact: no direction is sampled."""
    from picchio.cli.output import check_target, write_json
    from picchio.model import Model
    from picchio.robot import load_robot
    from picchio.studies.envelope import direction_envelope
    from picchio.studies.limits import warn_beyond_limits

    check_target(json, [robot, flex])
    loaded = load_robot(robot, flex=flex, tool=tool)
    check_target(json, loaded.files)
    blows = choose_blows(loaded, force, period, width)
    at = loaded.pose(parse_pose(pose))
    warn_beyond_limits(loaded, [at], "the pose")
    found = direction_envelope(Model(loaded, gravity_stiffness), at, blows, hits)
    if json is not None:
        write_json(found.to_dict(), json)
    if json != "-":
        _show(found)


def parse_pose(text: str) -> list[float]:
    """Numbers separated by commas.

    Raises:
        InputError: something that is no number.
    """
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError("must be numbers separated by commas", key="--pose", value=text) from None


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
    from picchio.excitation import ExcitationTable
    from picchio.studies.task import FORMAT, TaskTable

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
        elif getattr(table, key) is None and table.kind != "measured":
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


def _show(found: DirectionEnvelope) -> None:
    from rich import box
    from rich.table import Table

    from picchio.cli.output import console

    out = console()
    pose = ", ".join(f"{q:g}" for q in found.pose)
    how = "steady state" if found.hits is None else f"{found.hits} hits from rest"
    out.print(f"[bold]{found.robot}[/bold] at ({pose}), {how}")
    out.print(f"  {found.excitation.describe()}")
    frequencies = ", ".join(f"{f:.4f}" for f in found.natural_frequencies)
    out.print(f"  natural frequencies {frequencies} Hz\n")
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("joint")
    for name in ("peak\ndeflection\nmrad", "peak\ntorque\nN m", "peak\nstress\nMPa"):
        table.add_column(name, justify="right")
    table.add_column("worst direction\n(either sign)\nx, y, z", justify="right")
    rows = zip(
        found.joint_names,
        found.peak_deflection * 1e3,
        found.peak("torque"),
        found.peak("stress") / 1e6,
        found.worst_direction,
        strict=True,
    )
    for name, deflection, torque, stress, direction in rows:
        cells = [f"{deflection:.5g}", f"{torque:.4g}", "-" if stress != stress else f"{stress:.4g}"]
        table.add_row(name, *cells, ", ".join(f"{c + 0.0:.3f}" for c in direction.round(9)))
    out.print(table)
    x, y, z = found.worst_tool_direction
    out.print(
        f"The tool moves most, {found.peak_tool_displacement * 1e3:.4g} mm, under a force along "
        f"({x:.3f}, {y:.3f}, {z:.3f})."
    )
