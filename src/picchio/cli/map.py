"""`picchio map`: peaks, worst directions and frequencies all over the workspace."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from picchio.cli.envelope import ForceOption, PeriodOption, WidthOption, choose_blows
from picchio.cli.options import FlexOption, JsonOption, RobotArgument, ToolOption
from picchio.core.errors import InputError

if TYPE_CHECKING:
    from picchio.robot import FlexibleRobot
    from picchio.studies.places import Places

_SLICE = 1_000_000
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
        typer.Option(metavar="CSV", help="Points from x [m], y [m], z [m], and nx, ny, nz."),
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
    hits: Annotated[
        int | None, typer.Option(help="Blows of a burst from rest; steady state if not given.")
    ] = None,
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
        int | None, typer.Option(help="Processes; 0 for none. By default, as the map is large.")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="A dask scheduler to use instead.")
    ] = None,
    json: JsonOption = None,
) -> None:
    """Map the workspace; stopped and started again, it goes on where it was."""
    from picchio.cli.output import check_numbers, check_target, progress, write_json
    from picchio.robot import load_robot
    from picchio.studies.map import workspace_map

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
    along = direction if direction in ("worst", "normal") else _numbers(direction, "--direction")
    blows = choose_blows(loaded, force, period, width)
    with progress("places") as report:
        found = workspace_map(
            loaded, where, blows, out, direction=along, branch=branch, hits=hits,
            damage=_hits_of(loaded, hits) if damage else None, chunk=chunk,
            workers=workers, scheduler=scheduler, restart=restart, progress=report,
        )  # fmt: skip
    with found:
        summary = _summary(found, out)
    if json is not None:
        write_json(summary, json)
    if json != "-":
        _show(summary)


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
    from picchio.studies import places

    asked = {
        "--plane": plane, "--box": box or None, "--points": points, "--surface": surface,
        "--joint-grid": grid,
    }  # fmt: skip
    given = [key for key, value in asked.items() if value is not None]
    if len(given) > 1:
        raise InputError("choose one", key=" ".join(given), choices=list(asked))
    limits = None if bounds is None else _numbers(bounds, "--bounds")
    if points is not None:
        return places.points_from_csv(points)
    if surface is not None:
        if spacing is None:
            raise InputError("a surface needs it", key="--spacing")
        return places.surface(surface, spacing=spacing)
    if grid is not None:
        counts = [int(n) for n in _numbers(grid, "--joint-grid")]
        return places.joint_grid(robot, counts[0] if len(counts) == 1 else counts)
    if box:
        if spacing is None:
            raise InputError("a box needs it", key="--spacing")
        return places.box(robot, spacing=spacing, bounds=limits)
    return places.plane(robot, plane or "xz", at=at, spacing=spacing, bounds=limits)


def _hits_of(robot: FlexibleRobot, hits: int | None) -> int:
    """Blows of a rivet: as asked for, else as the robot's task has them, else a dozen."""
    from picchio.core.toml import parse_toml
    from picchio.studies.task import FORMAT, TaskTable

    if hits is not None:
        return hits
    if robot.task_path is None:
        return TaskTable.model_fields["hits_per_rivet"].get_default()  # type: ignore[no-any-return]
    return parse_toml(robot.task_path, TaskTable, format=FORMAT).hits_per_rivet


def _numbers(text: str, key: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError("must be numbers separated by commas", key=key, value=text) from None


def _summary(found: Any, out: Path) -> dict[str, Any]:
    """The largest deflection of every joint and where it is, read a slice at a time."""
    count = int(found.sizes["point"])
    names = [str(name) for name in found["joint"].values]
    best: dict[str, dict[str, Any]] = {}
    for first in range(0, count, _SLICE):
        part = found.isel(point=slice(first, first + _SLICE))
        peaks = part["peak_deflection"].values
        for j, name in enumerate(names):
            k = int(peaks[:, j].argmax())
            if name not in best or peaks[k, j] > best[name]["peak_deflection"]:
                row = part.isel(point=k)
                best[name] = {
                    "name": name,
                    "peak_deflection": float(peaks[k, j]),
                    "position": row["position"].values,
                    "pose": row["pose"].values,
                    "worst_direction": row["worst_direction"].values[j],
                }
        if "damage_per_rivet" in part:
            _most_damage(best, names, part["damage_per_rivet"].values)
    return {
        "format": "picchio-map/1",
        "robot": found.attrs["robot"],
        "file": str(out),
        "poses": count,
        "joints": list(best.values()),
    }


def _most_damage(best: dict[str, dict[str, Any]], names: list[str], damage: Any) -> None:
    import numpy as np

    for j, name in enumerate(names):
        known = damage[:, j][np.isfinite(damage[:, j])]
        if len(known):
            entry = best[name]
            entry["damage_per_rivet"] = max(entry.get("damage_per_rivet", 0.0), float(known.max()))


def _show(summary: dict[str, Any]) -> None:
    from picchio.cli.output import console

    screen = console()
    screen.print(f"[bold]{summary['robot']}[/bold]: {summary['poses']} poses in {summary['file']}")
    for joint in summary["joints"]:
        x, y, z = joint["position"] + 0.0
        screen.print(
            f"  {joint['name']}: up to {1e3 * joint['peak_deflection']:.4g} mrad, at "
            f"({x:.3f}, {y:.3f}, {z:.3f}) m{_told(joint)}"
        )


def _told(joint: dict[str, Any]) -> str:
    damage = joint.get("damage_per_rivet")
    return "" if damage is None else f"; a rivet costs up to {damage:.3g} of its life"
