"""`picchio view`: the 3-D scene as one offline HTML file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from picchio.cli.inputs import choose_blows, numbers
from picchio.cli.options import (
    FlexOption,
    ForceOption,
    GravityStiffnessOption,
    JsonOption,
    PeriodOption,
    RobotArgument,
    TaskOption,
    ToolOption,
    WidthOption,
)
from picchio.core.errors import InputError

if TYPE_CHECKING:
    import xarray

    from picchio.diagnosis.result import Diagnosis
    from picchio.robot.flexible_robot import FlexibleRobot
    from picchio.visuals.scene.scene import Scene

EPILOG = "Example: picchio view fanuc_like_3dof --out scene.html"


def register(app: typer.Typer) -> None:
    """Add the subcommand."""
    app.command(epilog=EPILOG)(view)


def view(
    robot: RobotArgument,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Where the HTML goes.", show_default=False),
    ] = None,
    live: Annotated[
        bool,
        typer.Option("--live", help="Show it in a live meshcat viewer, until it is interrupted."),
    ] = False,
    task: TaskOption = None,
    pose: Annotated[
        str | None,
        typer.Option(
            "--pose", metavar="Q1,Q2,...", help="rad or m; the task's worst pose if not given."
        ),
    ] = None,
    hits: Annotated[
        int | None,
        typer.Option(help="With --pose: blows of a burst from rest; steady state if not given."),
    ] = None,
    force: ForceOption = None,
    period: PeriodOption = None,
    width: WidthOption = None,
    map_: Annotated[
        Path | None,
        typer.Option("--map", metavar="FILE", help="A workspace map (picchio map) as a layer."),
    ] = None,
    diagnosis: Annotated[
        Path | None,
        typer.Option(
            "--diagnosis",
            metavar="FILE",
            help="What picchio diagnose --json found: the causes, where they sit.",
        ),
    ] = None,
    joint: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Whose envelope is shown first."),
    ] = None,
    flex: FlexOption = None,
    tool: ToolOption = None,
    gravity_stiffness: GravityStiffnessOption = False,
    json: JsonOption = None,
) -> None:
    """See it: robot, direction envelopes, rivets and vibration in one HTML file.

    The file needs no network. Without --pose the task is assessed and shown at its worst rivet.
    """
    from picchio.cli.output import check_target, write_json
    from picchio.core.files import atomic_write
    from picchio.model.model import Model
    from picchio.robot.loading.load import load_robot
    from picchio.visuals.scene.build import build_scene

    if out is None and not live:
        raise InputError("needs a file", key="--out", hint="--out scene.html, or --live")
    check_target(out, [flex, task, map_, diagnosis])
    loaded = load_robot(robot, flex=flex, tool=tool)
    found = _diagnosis(diagnosis, loaded)
    workspace = None
    if map_ is not None:
        from picchio.studies.maps.run import open_map

        workspace = open_map(map_)
    if pose is None:
        for key, value in (("--force", force), ("--period", period), ("--width", width),
                           ("--hits", hits)):  # fmt: skip
            if value is not None:
                raise InputError("needs --pose: a task says its blows itself", key=key, value=value)
        scene = _of_task(loaded, task, joint, gravity_stiffness, workspace, found)
    else:
        blows = choose_blows(loaded, force, period, width, task)
        at = loaded.pose(numbers(pose, "--pose"))
        Model(loaded, gravity_stiffness).linear_system(at)  # bad numbers are told before meshes
        scene = build_scene(
            loaded,
            at,
            blows,
            hits=hits,
            joint=joint,
            gravity_stiffness=gravity_stiffness,
            workspace=workspace,
            diagnosis=found,
        )
    size = 0
    if out is not None:
        page = scene.html()
        size = len(page.encode())
        with atomic_write(out) as stream:
            stream.write(page)
        typer.echo(f"{out}: {scene.title}, {size / 1e6:.1f} MB; open it in a browser", err=True)
    if json is not None:
        write_json(_summary(scene, out, size), json)
    if live:
        _show_live(scene)


def _of_task(
    robot: FlexibleRobot,
    task: Path | None,
    joint: str | None,
    gravity_stiffness: bool,
    workspace: xarray.Dataset | None,
    diagnosis: Diagnosis | None,
) -> Scene:
    from picchio.cli.output import progress
    from picchio.studies.assessment.run import assess
    from picchio.studies.tasks import load_task
    from picchio.visuals.scene.build import build_scene
    from picchio.visuals.worst_rivet import worst_rivet

    path = task or robot.task_path
    if path is None:
        raise InputError(
            f"{robot.name} has no example task of its own", key="--task", hint="give one, or --pose"
        )
    work = load_task(path, robot)
    with progress("poses") as report:
        life = assess(robot, work, gravity_stiffness=gravity_stiffness, progress=report)
    worst = worst_rivet(life, robot, work, gravity_stiffness=gravity_stiffness)
    return build_scene(
        robot,
        worst.pose,
        worst.operation.excitation,
        hits=worst.operation.hits_per_rivet,
        direction=worst.operation.direction,
        assessment=life,
        joint=joint,
        gravity_stiffness=gravity_stiffness,
        workspace=workspace,
        diagnosis=diagnosis,
    )


def _diagnosis(path: Path | None, robot: FlexibleRobot) -> Diagnosis | None:
    """The diagnosis of a file, if it can be one of this robot."""
    if path is None:
        return None
    from picchio.visuals.diagnosis_file import read_diagnosis

    return read_diagnosis(path, robot)


def _show_live(scene: Scene) -> None:
    """Serve the scene until somebody has seen enough."""
    import contextlib
    import sys
    import warnings

    # What meshcat uses and leaves open is nobody's concern here.
    for kind in (DeprecationWarning, ResourceWarning):
        warnings.simplefilter("ignore", kind)
    # Meshcat greets on stdout, which is for JSON alone.
    with contextlib.redirect_stdout(sys.stderr):
        viewer = scene.show()
    typer.echo("Ctrl-C ends it", err=True)
    try:
        viewer.window.server_proc.wait()
    except KeyboardInterrupt:
        viewer.window.server_proc.kill()


def _summary(scene: Scene, out: Path | None, size: int) -> dict[str, Any]:
    """What `--json` writes."""
    return {
        "format": "picchio-scene/1",
        "file": None if out is None else str(out),
        "bytes": size,
        "layers": [{"id": name, "text": text} for name, text, _ in scene.layers],
        "envelope": scene.envelope.to_dict(),
        "provenance": dict(scene.envelope.origin),
    }
