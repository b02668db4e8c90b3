"""`picchio simulate`: the campaign that a test plan would give."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from picchio.cli.options import FlexOption, JsonOption, RobotArgument, ToolOption

EPILOG = "Example: picchio simulate fanuc_like_3dof --plan plan.toml --to campaign"


def register(app: typer.Typer) -> None:
    """Add the subcommand."""
    app.command(epilog=EPILOG)(simulate)


def simulate(
    robot: RobotArgument,
    plan: Annotated[
        Path,
        typer.Option("--plan", metavar="PLAN.toml", help="The test plan.", show_default=False),
    ],
    to: Annotated[
        Path,
        typer.Option("--to", metavar="CAMPAIGN", help="The campaign's folder.", show_default=False),
    ],
    flex: FlexOption = None,
    tool: ToolOption = None,
    gravity_stiffness: Annotated[
        bool,
        typer.Option(
            "--gravity-stiffness/--no-gravity-stiffness",
            help="Add gravity's stiffness dg/dq to the springs'.",
        ),
    ] = True,
    seed: Annotated[
        int | None, typer.Option("--seed", min=0, help="Of the noise; the plan's if not given.")
    ] = None,
    parquet: Annotated[
        bool, typer.Option("--parquet", help="Write Parquet files instead of CSV.")
    ] = False,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace a campaign that stands there.")
    ] = False,
    json: JsonOption = None,
) -> None:
    """Simulate a test before doing it: which sensors, poses, directions, levels.

    The plan (picchio-plan/1, TOML) names poses, directions, levels, blows, sample rate and
    sensors with their noise; [[effect]] tables in it make the world differ from the model.
    """
    import picchio
    from picchio.cli.output import check_target, progress, write_json

    check_target(json, [robot, flex, plan])
    loaded = picchio.load_robot(robot, flex=flex, tool=tool)
    check_target(json, loaded.files)
    with progress("records") as report:
        made = picchio.simulate(
            loaded,
            plan,
            to,
            robot_name=robot,
            seed=seed,
            gravity_stiffness=gravity_stiffness,
            parquet=parquet,
            overwrite=overwrite,
            progress=report,
        )
    if json is not None:
        write_json(made.to_dict(), json)
    if json != "-":
        typer.echo(f"{to}: {made._headline()}")
        typer.echo("  " + ", ".join(made.campaign.records[0].channels))
