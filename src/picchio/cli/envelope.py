"""`picchio envelope`: what a force can do to each joint at a pose, by its direction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

from picchio.cli.options import (
    FlexOption,
    ForceOption,
    GravityStiffnessOption,
    HitsOption,
    JsonOption,
    PeriodOption,
    PoseOption,
    RobotArgument,
    ToolOption,
    WidthOption,
)

if TYPE_CHECKING:
    from picchio.studies.envelopes import DirectionEnvelope

EPILOG = "Example: picchio envelope fanuc_like_3dof --pose=0.3,1.1,-1.0"


def register(app: typer.Typer) -> None:
    """Add the subcommand."""
    app.command(epilog=EPILOG)(envelope)


def envelope(
    robot: RobotArgument,
    pose: PoseOption,
    force: ForceOption = None,
    period: PeriodOption = None,
    width: WidthOption = None,
    hits: HitsOption = None,
    flex: FlexOption = None,
    tool: ToolOption = None,
    gravity_stiffness: GravityStiffnessOption = False,
    json: JsonOption = None,
) -> None:
    """The worst force direction of every joint at a pose, exact: no direction is sampled."""
    from picchio.cli.inputs import numbers
    from picchio.cli.output import check_target, write_json
    from picchio.robot.dynamics.pose import warn_beyond_limits
    from picchio.robot.loading.load import load_robot
    from picchio.studies.blows import blows_of
    from picchio.studies.envelopes import envelope as run

    check_target(json, [robot, flex])
    loaded = load_robot(robot, flex=flex, tool=tool)
    check_target(json, loaded.files)
    blows = blows_of(loaded, force=force, period=period, width=width)
    at = loaded.pose(numbers(pose, "--pose"))
    warn_beyond_limits(loaded, [at], "the pose")
    found = run(loaded, at, blows, hits=hits, gravity_stiffness=gravity_stiffness)
    if json is not None:
        write_json(found.to_dict(), json)
    if json != "-":
        _show(found)


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
