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
    from picchio.cli.output import check_target, write_json
    from picchio.core.errors import InputError
    from picchio.core.files import atomic_write
    from picchio.core.provenance import provenance
    from picchio.robot.annotations.annotate import annotate as annotated
    from picchio.robot.annotations.sidecar import read_sidecar
    from picchio.robot.loading.find import find_robot

    for target in (out, json):
        check_target(target, [flex])
    found = find_robot(robot)
    sidecar = flex or found.flex
    if sidecar is None:
        raise InputError("this robot has no flex.toml of its own", key="--flex",
                         hint="name a sidecar")  # fmt: skip
    for target in (out, json):
        check_target(target, [found.urdf, sidecar])
    content = annotated(found.urdf, read_sidecar(sidecar))
    with atomic_write(out, "wb") as stream:
        stream.write(content)
    if json is not None:
        record = {"format": "picchio-annotation/1", "file": str(out)}
        write_json(record | {"provenance": provenance([found.urdf, sidecar])}, json)
    typer.echo(f"{out}: {found.urdf.name} with the values of {sidecar.name}", err=True)
