"""`picchio view`: the 3-D scene as one offline HTML file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from picchio.cli import options as typed
from picchio.cli.app import app
from picchio.cli.ending import ending
from picchio.cli.output import deliver, progress, telling
from picchio.core.errors import InputError

if TYPE_CHECKING:
    from picchio.visuals.scene.scene import Scene


@app.command()
def view(
    given: typed.RobotGiven,
    *,
    out: Annotated[Path | None, typed.output("--out", *typed.PAGES)] = None,
    rerun: Annotated[Path | None, typed.output("--rerun", ".rrd")] = None,
    live: bool = False,
    task: typed.TaskOption = None,
    pose: str | None = None,
    hits: int | None = None,
    blows: typed.BlowsGiven,
    map_: Annotated[Path | None, typer.Option("--map")] = None,
    diagnosis: Path | None = None,
    joint: Annotated[str | None, typer.Option(autocompletion=typed.joint_names)] = None,
    gravity_stiffness: typed.GravityStiffnessOption = None,
    json: typed.JsonOption = None,
) -> None:
    """The robot in 3-D as HTML: envelopes, rivets and vibration.

    The file needs no network. Without --pose the task is assessed and shown at its worst rivet.

    Options:
        out (FILE): Where the HTML goes; ROBOT-scene.html if not given.
        rerun (FILE): Write the vibration as a Rerun recording (.rrd); needs picchio[rerun].
        live: Show it in a live meshcat viewer until Ctrl-C.
        pose (Q1,Q2,...): Joint positions, rad or m: Q1,Q2,..., or NAME=VALUE,... (the rest at
            zero), or a name. The task's worst rivet if not given.
        hits: With --pose: blows of a burst from rest; steady state if not given.
        map_ (FILE): Show a workspace map, of `picchio map`.
        diagnosis (FILE): Show the causes found, from the JSON of `picchio diagnose`.
        joint (NAME): The joint whose envelope is shown first.
    """
    import picchio

    loaded = given.load()
    if out is None and rerun is None and not live:
        out = typed.out_beside(loaded.name, "-scene.html")
    if pose is None:
        for key, value in vars(blows).items():
            if value is not None:
                raise InputError("needs --pose: a task says its blows itself", key=f"--{key}",
                                 value=value)  # fmt: skip
    with progress("poses") as tell:
        scene = picchio.view(
            loaded,
            task=task,
            pose=None if pose is None else typed.pose_given(pose),
            excitation=None if pose is None else blows.on(loaded, task),
            hits=hits,
            workspace=map_,
            diagnosis=diagnosis,
            joint=joint,
            gravity_stiffness=gravity_stiffness,
            progress=tell,
        )
    if out is not None:
        with telling("writing the scene"):
            scene.save(out)
    if rerun is not None:
        from picchio.visuals.scene.recording import write_recording

        with telling("writing the recording"):
            write_recording(scene, rerun)
    deliver(scene.to_dict(), json)
    if live:
        _show_live(scene)


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
        ending.heard()
        viewer.window.server_proc.kill()
