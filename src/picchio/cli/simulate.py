"""`picchio simulate`: the campaign that a test plan would give."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from picchio.cli.options import FlexOption, JsonOption, RobotArgument, ToolOption

if TYPE_CHECKING:
    from picchio.campaign.campaign import Campaign
    from picchio.prediction.plan import Plan

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
    from picchio.campaign.campaign import write_campaign
    from picchio.cli.output import check_target, progress, write_json
    from picchio.core.errors import InputError
    from picchio.core.provenance import provenance
    from picchio.prediction.plan import read_plan
    from picchio.prediction.simulation import simulate as run
    from picchio.robot.dynamics.pose import warn_beyond_limits
    from picchio.robot.loading.load import load_robot

    check_target(json, [robot, flex, plan])
    loaded = load_robot(robot, flex=flex, tool=tool)
    asked = read_plan(plan)
    if seed is not None:
        asked = asked.model_copy(update={"seed": seed})
    check_target(json, loaded.files)
    files = [plan, *loaded.files]
    try:
        warn_beyond_limits(loaded, [loaded.pose(p) for p in asked.poses], "the plan")  # type: ignore[arg-type]
        with progress("records") as report:
            made = run(
                loaded,
                asked,
                robot_name=str(robot),
                gravity_stiffness=gravity_stiffness,
                suffix=".parquet" if parquet else ".csv",
                inputs=files,
                progress=report,
            )
    except InputError as error:
        if error.file is not None:
            raise
        raise error.placed(file=plan) from None
    written = write_campaign(made, to, overwrite=overwrite)
    if json is not None:
        write_json(
            {
                "format": "picchio-simulation/1",
                "campaign": str(to),
                "robot": loaded.name,
                "records": [record.file for record in written.records],
                "channels": list(written.records[0].channels),
                "samples": written.records[0].clock.samples,
                "sample_rate": asked.sample_rate,
                "effects": [table.model_dump() for table in asked.effect],
                "provenance": provenance(files, seed=asked.seed),
            },
            json,
        )
    if json != "-":
        _show(written, asked, to)


def _show(written: Campaign, plan: Plan, to: Path) -> None:
    before, after = plan.samples
    blows = "steady state" if plan.burst is None else f"{plan.burst} blows from rest"
    records = len(written.records)
    typer.echo(
        f"{to}: {records} record{'s' if records != 1 else ''}, {len(plan.poses)} poses, "
        f"{before + after} samples at {plan.sample_rate:g} Hz, {blows}"
    )
    typer.echo("  " + ", ".join(written.records[0].channels))
