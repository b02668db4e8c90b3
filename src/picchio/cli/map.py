"""`picchio map`: peaks, worst directions and frequencies all over the workspace."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from picchio.cli.inputs import numbers
from picchio.cli.options import (
    FlexOption,
    ForceOption,
    HitsOption,
    JsonOption,
    PeriodOption,
    RobotArgument,
    ToolOption,
    WidthOption,
)
from picchio.core.errors import InputError

if TYPE_CHECKING:
    from picchio.robot.flexible_robot import FlexibleRobot
    from picchio.studies.maps.places import Places


def show(summary: dict[str, Any]) -> None:
    """Print it."""
    from rich import box
    from rich.table import Table

    from picchio.cli.output import console

    out = console()
    out.print(f"[bold]{summary['robot']}[/bold]: {summary['poses']} poses in {summary['file']}")
    hits, counted = summary["hits"], summary["hits_of_damage"]
    when = "steady state" if hits is None else f"{hits} hits from rest"
    along = {"worst": "each joint's worst direction", "normal": "along the surface's normal"}
    out.print(
        f"  {summary['excitation']}; {when}, "
        f"{along.get(summary['direction'], 'along ' + summary['direction'])}"
    )
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("joint")
    # Stresses rank joints; where not every joint has a shaft, torques do.
    shafts = all(joint["peak_shear_stress"] is not None for joint in summary["joints"])
    limit = "most stress" if shafts else "most torque"
    heads = ["largest\ndeflection\nmrad", "torque\nthere\nN m", "stress\nthere\nMPa",
             "where\nm", f"{limit},\n% of\nposes"]  # fmt: skip
    for head in heads + (["damage of\na rivet,\nat most"] if counted else []):
        table.add_column(head, justify="right")
    for joint in summary["joints"]:
        stress = joint["peak_shear_stress"]
        cells = [
            f"{1e3 * joint['peak_deflection']:.4g}",
            f"{joint['peak_torque']:.4g}",
            "-" if stress is None else f"{stress / 1e6:.4g}",
            ", ".join(f"{round(c, 3) + 0.0:.3f}" for c in joint["position"]),
            f"{100 * joint['limits_poses'] / summary['poses']:.1f}",
        ]
        if counted:
            damage = joint.get("damage_per_rivet")
            cells.append("-" if damage is None else f"{damage:.3g}")
        table.add_row(joint["name"], *cells)
    out.print(table)
    if counted:
        none = all(joint.get("damage_per_rivet", 0.0) == 0.0 for joint in summary["joints"])
        out.print(
            f"Damage: a rivet of {counted} hits from rest, cycles counted"
            + ("; no stress is beyond an endurance limit, so none does any." if none else ".")
        )


EPILOG = "Example: picchio map fanuc_like_3dof --plane xz --spacing 0.1 --out map.nc"


def register(app: typer.Typer) -> None:
    """Add the subcommand."""
    app.command("map", epilog=EPILOG)(map_)


def map_(
    robot: RobotArgument,
    out: Annotated[
        Path, typer.Option("--out", metavar="FILE", help="map.nc (netCDF) or map.zarr (Zarr).")
    ],
    plane: Annotated[
        str | None, typer.Option(help="Points on a plane: xy, xz or yz; xz if no places are given.")
    ] = None,
    at: Annotated[float, typer.Option(help="m, where the plane cuts the third axis.")] = 0.0,
    box: Annotated[bool, typer.Option("--box", help="Points in a box.")] = False,
    points: Annotated[
        Path | None,
        typer.Option(
            metavar="CSV",
            help="Points from columns x \\[m], y \\[m], z \\[m], and normals nx, ny, nz.",
        ),
    ] = None,
    surface: Annotated[
        Path | None,
        typer.Option(metavar="MESH", help="Points on a mesh (STL, ...; m, world); see --spacing."),
    ] = None,
    joint_grid: Annotated[
        str | None, typer.Option(metavar="N[,N...]", help="Poses on a grid in joint space.")
    ] = None,
    spacing: Annotated[float | None, typer.Option(help="m, between points.")] = None,
    bounds: Annotated[
        str | None, typer.Option(metavar="LOW,HIGH,...", help="m, for each axis of plane or box.")
    ] = None,
    direction: Annotated[
        str | None,
        typer.Option(
            help="x,y,z of the force; worst for each joint; normal of the surface. By default "
            "worst; of a --surface, normal."
        ),
    ] = None,
    branch: Annotated[
        str, typer.Option(help="all, any, elbow-up, elbow-down, or words such as joint_3+.")
    ] = "all",
    hits: HitsOption = None,
    damage: Annotated[
        bool,
        typer.Option(
            "--damage", help="Count a rivet's damage as well: --hits blows, or the task's."
        ),
    ] = False,
    force: ForceOption = None,
    period: PeriodOption = None,
    width: WidthOption = None,
    flex: FlexOption = None,
    tool: ToolOption = None,
    chunk: Annotated[int, typer.Option(help="Places at a time.")] = 4096,
    restart: Annotated[
        bool, typer.Option("--restart", help="Throw away what an interrupted map has left.")
    ] = False,
    workers: Annotated[
        int | None,
        typer.Option(
            help="Processes; up to 1, no other is started. By default, as the map is large."
        ),
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="A dask scheduler to use instead.")
    ] = None,
    json: JsonOption = None,
) -> None:
    """Map the workspace; a map that was stopped resumes."""
    from picchio.cli.output import check_numbers, check_target, progress, write_json
    from picchio.robot.loading.load import load_robot
    from picchio.studies.blows import blows_of
    from picchio.studies.maps.run import workspace_map

    for target in (out, json):
        check_target(target, [robot, flex, points, surface])
    check_numbers(at=at, spacing=spacing)
    for key, number, least in (
        ("--chunk", chunk, 1),
        ("--workers", workers, 0),
        ("--hits", hits, 1),
    ):
        if number is not None and number < least:
            raise InputError(f"must be at least {least}", key=key, value=number)
    loaded = load_robot(robot, flex=flex, tool=tool)
    check_target(out, loaded.files)
    where = _places(loaded, plane, at, box, points, surface, joint_grid, spacing, bounds)
    if direction is None:
        direction = "worst" if surface is None else "normal"
    along = direction if direction in ("worst", "normal") else numbers(direction, "--direction")
    blows = blows_of(loaded, force=force, period=period, width=width)
    with progress("places") as report:
        found = workspace_map(
            loaded, where, blows, out, direction=along, branch=branch, hits=hits,
            damage=_hits_of(loaded, hits) if damage else None, chunk=chunk,
            workers=workers, scheduler=scheduler, restart=restart, progress=report,
        )  # fmt: skip
    with found:
        summary = found.to_dict()
    if json is not None:
        write_json(summary, json)
    if json != "-":
        show(summary)


def _places(
    robot: FlexibleRobot,
    plane: str | None,
    at: float,
    box: bool,
    points: Path | None,
    surface: Path | None,
    grid: str | None,
    spacing: float | None,
    bounds: str | None,
) -> Places:
    from picchio.studies.maps import places

    asked = {
        "--plane": plane, "--box": box or None, "--points": points, "--surface": surface,
        "--joint-grid": grid,
    }  # fmt: skip
    chosen = [key for key, value in asked.items() if value is not None]
    if len(chosen) > 1:
        raise InputError("choose one", key=" ".join(chosen), choices=list(asked))
    limits = None if bounds is None else numbers(bounds, "--bounds")
    if points is not None:
        return places.points_from_csv(points)
    if surface is not None:
        if spacing is None:
            raise InputError("a surface needs it", key="--spacing")
        return places.surface(surface, spacing=spacing)
    if grid is not None:
        given = numbers(grid, "--joint-grid")
        if any(n != round(n) for n in given):
            raise InputError("must be whole numbers", key="--joint-grid", value=grid)
        counts = [round(n) for n in given]
        return places.joint_grid(robot, counts[0] if len(counts) == 1 else counts)
    if box:
        if spacing is None:
            raise InputError("a box needs it", key="--spacing")
        return places.box(robot, spacing=spacing, bounds=limits)
    return places.plane(robot, plane or "xz", at=at, spacing=spacing, bounds=limits)


def _hits_of(robot: FlexibleRobot, hits: int | None) -> int:
    """Blows of a rivet: as asked for, else as the robot's task has them, else a dozen."""
    from picchio.core.toml import parse_toml
    from picchio.studies.tasks import FORMAT, TaskTable

    if hits is not None:
        return hits
    if robot.task_path is None:
        return TaskTable.model_fields["hits_per_rivet"].get_default()  # type: ignore[no-any-return]
    return parse_toml(robot.task_path, TaskTable, format=FORMAT).hits_per_rivet
