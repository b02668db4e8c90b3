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
TaskOption = Annotated[
    Path | None,
    typer.Option("--task", metavar="FILE", help="Task (TOML); the robot's own if not given."),
]
SNCurveOption = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="S-N curve for all joints: a name or a TOML file."),
]
PoseOption = Annotated[
    str, typer.Option("--pose", metavar="Q1,Q2,...", help="Joint positions, rad or m.")
]
ForceOption = Annotated[
    float | None, typer.Option(help="N, height of a blow; the example task's if not given.")
]
PeriodOption = Annotated[float | None, typer.Option(help="s, from one blow to the next.")]
WidthOption = Annotated[float | None, typer.Option(help="s, width of a blow.")]
HitsOption = Annotated[
    int | None, typer.Option(help="Blows of a burst from rest; steady state if not given.")
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
