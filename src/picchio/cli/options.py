"""Arguments and options that several subcommands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

RobotArgument = Annotated[
    str,
    typer.Argument(
        metavar="ROBOT",
        help="A name from `picchio robots`, or a path to a URDF.",
        show_default=False,
    ),
]
FlexOption = Annotated[
    Path | None,
    typer.Option("--flex", metavar="FILE", help="Sidecar with stiffnesses and shafts (TOML)."),
]
ToolOption = Annotated[
    str | None, typer.Option("--tool", metavar="FRAME", help="Frame where the tool's force acts.")
]
JsonOption = Annotated[
    str | None,
    typer.Option("--json", metavar="FILE", help="Write the result as JSON; - for stdout."),
]
GravityStiffnessOption = Annotated[
    bool,
    typer.Option(
        "--gravity-stiffness/--no-gravity-stiffness",
        help="Add gravity's stiffness dg/dq to the springs'.",
    ),
]
