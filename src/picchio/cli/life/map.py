"""`picchio map`: peaks, worst directions and frequencies all over the workspace."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from picchio.cli import options as typed
from picchio.cli import output
from picchio.cli.app import app
from picchio.core.errors import InputError

if TYPE_CHECKING:
    from picchio.excitation.excitation import Excitation
    from picchio.robot.flexible_robot import FlexibleRobot
    from picchio.studies.maps.places import Places
    from picchio.studies.maps.result import WorkspaceMap


@app.command("map")
def map_(
    given: typed.RobotGiven,
    *,
    out: Annotated[Path | None, typed.output("--out")] = None,
    plane: str | None = None,
    at: float = 0.0,
    box: bool = False,
    points: Path | None = None,
    surface: Path | None = None,
    joint_grid: str | None = None,
    spacing: float | None = None,
    bounds: str | None = None,
    direction: str | None = None,
    branch: str = "all",
    hits: typed.HitsOption = None,
    damage: bool = False,
    blows: typed.BlowsGiven,
    chunk: Annotated[int | None, typer.Option(min=1)] = None,
    restart: bool = False,
    workers: Annotated[int | None, typer.Option(min=0)] = None,
    scheduler: str | None = None,
    plot: Annotated[Path | None, typed.output("--plot", *typed.PICTURES)] = None,
    html: Annotated[Path | None, typed.output("--html", *typed.PAGES)] = None,
    json: typed.JsonOption = None,
) -> None:
    """Peaks, worst directions and frequencies over the workspace.

    A map that was interrupted resumes when the same command is given again.

    Options:
        out (FILE): map.nc (netCDF) or map.zarr (Zarr); ROBOT-map.nc if not given.
        plane (PLANE): Points on a plane: xy, xz or yz; the default is xz.
        at (M): Where the plane cuts the third axis, m.
        box: Points in a box.
        points (CSV): Points from columns x [m], y [m], z [m], with normals from nx, ny, nz if
            there.
        surface (MESH): Points on a mesh (STL, OBJ, PLY, ...; m, world).
        joint_grid (N[,N...]): Poses on a grid of N positions a joint.
        spacing (M): Distance of points on a plane, in a box or on a mesh, m.
        bounds (LOW,HIGH,...): Ends along each axis, m; all within reach if not given.
        direction (X,Y,Z): Direction of the force; or `worst` (each joint's own), the default; or
            `normal` (to the surface), the default with --surface.
        branch (WORD): Branches of the inverse kinematics: all, any (one), elbow-up, elbow-down, or
            signs of joints such as joint_3+.
        damage: Count the damage of a rivet, too: --hits blows, or the task's.
        chunk (N): Places computed and kept at a time; if not given, 64 to 16384 by what one takes.
        restart: Start afresh, though an interrupted map could be resumed.
        workers (N): Worker processes; 0 or 1: none. By default one a core for large maps.
        scheduler (ADDRESS): A dask scheduler, instead of own processes.
        plot (FILE): Draw it, a joint below the other: .png, .svg or .pdf.
        html (FILE): The map in 3-D, to turn and to cut, as one HTML file.
    """
    import picchio
    from picchio.studies.tasks import hits_of_rivet

    with output.notice_first(json):
        loaded = given.load()
    out = out or typed.out_beside(loaded.name, "-map.nc")
    where = _places(loaded, plane, at, box, points, surface, joint_grid, spacing, bounds)
    if direction is None:
        direction = "worst" if surface is None else "normal"
    along = (
        direction if direction in ("worst", "normal") else typed.numbers(direction, "--direction")
    )
    train = blows.on(loaded)
    with output.progress("places") as report:
        found = picchio.workspace_map(
            loaded,
            where,
            train,
            out,
            direction=along,
            branch=branch,
            hits=hits,
            damage=(hits or hits_of_rivet(loaded)) if damage else None,
            chunk=chunk,
            workers=workers,
            scheduler=scheduler,
            restart=restart,
            progress=report,
        )
    with found:
        summary = found.to_dict()
        _draw(found, loaded, train, hits, plot, html)
    output.deliver(summary, json, lambda: _show(summary))


def _draw(
    found: WorkspaceMap,
    robot: FlexibleRobot,
    blows: Excitation,
    hits: int | None,
    plot: Path | None,
    html: Path | None,
) -> None:
    """The map as a picture and as a page."""
    if plot is not None:
        from picchio.core.files import atomic_write
        from picchio.visuals.plots.workspace import workspace_figure

        with output.telling("drawing the map"), atomic_write(plot, "wb") as stream:
            workspace_figure(found).savefig(stream, format=plot.suffix[1:], dpi=150)
    if html is not None:
        import numpy as np

        import picchio

        peak = found.dataset["peak_deflection"].values
        row = int(np.nanargmax(np.nanmax(np.where(np.isfinite(peak), peak, -1.0), axis=1)))
        pose = found.dataset["pose"].values[row]
        with output.telling("drawing the page"):
            scene = picchio.view(robot, pose=pose, excitation=blows, hits=hits, workspace=found)
            scene.playing = False
            scene.save(html)


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

    asked = {"--plane": plane, "--box": box or None, "--points": points, "--surface": surface,
             "--joint-grid": grid}  # fmt: skip
    chosen = [key for key, value in asked.items() if value is not None]
    if len(chosen) > 1:
        raise InputError("choose one", key=" ".join(chosen), choices=list(asked))
    if points is not None:
        return places.points_from_csv(points)
    if grid is not None:
        counts = typed.numbers(grid, "--joint-grid")
        if not all(n.is_integer() for n in counts):
            raise InputError("must be whole numbers", key="--joint-grid", value=grid)
        whole = [round(n) for n in counts]
        return places.joint_grid(robot, whole[0] if len(whole) == 1 else whole)
    limits = None if bounds is None else typed.numbers(bounds, "--bounds")
    if surface is None and not box:
        return places.plane(robot, plane or "xz", at=at, spacing=spacing, bounds=limits)
    if spacing is None:
        raise InputError("a box or a surface needs it", key="--spacing")
    if surface is not None:
        return places.surface(surface, spacing=spacing)
    return places.box(robot, spacing=spacing, bounds=limits)


def _show(summary: dict[str, Any]) -> None:
    from picchio.studies.maps.result import listing_of

    out = output.console()
    for note in summary["notes"]:
        out.print(f"{note}.", style="bold yellow")
    out.print(output.styled(summary["robot"], f": {summary['poses']} poses in {summary['file']}"))
    counted = summary["hits_of_damage"]
    along = {"worst": "each joint's worst direction", "normal": "along the surface's normal"}
    out.print(
        f"  {summary['excitation']}; {summary['response']}, "
        f"{along.get(summary['direction'], 'along ' + summary['direction'])}"
    )
    title = "P10 to P90, where P90 is largest" if "estimate" in summary["joints"][0] else ""
    out.print(output.listed(listing_of(summary), title))
    if counted:
        none = all(joint.get("damage_per_rivet", 0.0) == 0.0 for joint in summary["joints"])
        out.print(
            f"Damage: a rivet of {counted} hits from rest, cycles counted"
            + ("; no stress is beyond an endurance limit, so none does any." if none else ".")
        )
