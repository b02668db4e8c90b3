"""`picchio annotate`: the URDF with a sidecar's values in it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from picchio.cli.options import FlexOption, JsonOption, RobotArgument

EPILOG = "Example: picchio annotate ur10 --flex my_ur10.toml --out robot.urdf"


def register(app: typer.Typer) -> None:
    """Add the subcommand."""
    app.command(epilog=EPILOG)(annotate)


def annotate(
    robot: RobotArgument,
    out: Annotated[
        Path,
        typer.Option("--out", metavar="FILE", help="Where the URDF goes.", show_default=False),
    ],
    flex: FlexOption = None,
    json: JsonOption = None,
) -> None:
    """Write a URDF with the sidecar's values as annotations; everything else stays as it is.

    Without --flex the robot's own flex.toml is used. Mesh files are not copied.
    """
    import picchio
    from picchio.cli.output import check_target, write_json

    for target in (out, json):
        check_target(target, [flex])
    made = picchio.annotate(robot, flex=flex)
    for target in (out, json):
        check_target(target, [made.urdf, made.sidecar])
    made.save(out)
    if json is not None:
        write_json(made.to_dict(), json)
    typer.echo(f"{out}: {made.urdf.name} with the values of {made.sidecar.name}", err=True)
