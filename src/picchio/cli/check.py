"""`picchio check`: what is in measured data, and what is wrong with them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from picchio.cli.options import FlexOption, JsonOption, ToolOption

if TYPE_CHECKING:
    from picchio.campaign import Campaign
    from picchio.prediction.quality import Finding, QualityReport
    from picchio.robot import FlexibleRobot

EPILOG = "Example: picchio check measurements/ --robot fanuc_like_3dof --json check.json"


def register(app: typer.Typer) -> None:
    """Add the subcommand."""
    app.command(epilog=EPILOG)(check)


def check(
    campaign: Annotated[
        Path,
        typer.Argument(metavar="CAMPAIGN", help="Folder with a campaign.toml.", show_default=False),
    ],
    robot: Annotated[
        str | None,
        typer.Option(
            "--robot", metavar="ROBOT", help="A name or a URDF; the campaign's own if not given."
        ),
    ] = None,
    no_robot: Annotated[
        bool, typer.Option("--no-robot", help="Leave out what needs a robot.")
    ] = False,
    flex: FlexOption = None,
    tool: ToolOption = None,
    keep_going: Annotated[
        bool,
        typer.Option("--keep-going", help="List records that cannot be read, check the others."),
    ] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Every record, and every finding on its own.")
    ] = False,
    gravity_stiffness: Annotated[
        bool,
        typer.Option(
            "--gravity-stiffness/--no-gravity-stiffness",
            help="Of the report's simulation: add gravity's stiffness dg/dq to the springs'.",
        ),
    ] = True,
    report: Annotated[
        Path | None,
        typer.Option(
            "--report", metavar="OUT.html", help="How the simulation differs, one page to read."
        ),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Check measured data: what is in a campaign, and what is wrong with it.

    Clipping, dropouts, spikes, drift, uneven clocks, swapped or flipped axes, hum, high-passes,
    delays, records that are too short, aliasing, repeats, and the noise of every channel.
    """
    import dataclasses
    import math

    from picchio.campaign import load_campaign
    from picchio.cli.check_tables import show, warning_lines
    from picchio.cli.output import check_target, progress, say_warning, write_json
    from picchio.core.errors import InputError
    from picchio.prediction.quality import check_campaign

    if no_robot and (robot is not None or flex is not None or tool is not None):
        raise InputError("stands against --robot, --flex and --tool", key="--no-robot")
    if report is not None and no_robot:
        raise InputError("needs a robot", key="--report")
    for target in (json, report):
        check_target(target, [robot, flex])
    loaded = load_campaign(campaign, clock_tolerance=math.inf)
    for target in (json, report):
        check_target(target, loaded.files)
    found, problem = (None, None) if no_robot else _robot(loaded, robot, flex, tool)
    if report is not None and found is None:
        raise InputError("needs a robot", key="--report", hint="name one with --robot")
    with progress("records") as tell:
        result = check_campaign(loaded, found, keep_going=keep_going, progress=tell)
    if problem is not None:
        result = dataclasses.replace(result, findings=(problem, *result.findings))
    if report is not None and found is not None:
        _write_report(report, found, loaded, result, gravity_stiffness)
    if json is not None:
        write_json(result.to_dict(), json)
    if json != "-":
        show(result, verbose=verbose)
    else:
        for line in warning_lines(result):
            say_warning(line)


def _write_report(
    target: Path,
    robot: FlexibleRobot,
    campaign: Campaign,
    result: QualityReport,
    gravity_stiffness: bool,
) -> None:
    """The page of how the simulation differs."""
    import shlex
    import sys

    from picchio.cli.output import said_warnings
    from picchio.core.files import atomic_write
    from picchio.view.report.residual import residual_report

    page = residual_report(
        robot,
        campaign,
        quality=result,
        command=shlex.join(["picchio", *sys.argv[1:]]),
        warnings=said_warnings(),
        gravity_stiffness=gravity_stiffness,
    )
    with atomic_write(target) as stream:
        stream.write(page)


def _robot(
    campaign: Campaign, robot: str | None, flex: Path | None, tool: str | None
) -> tuple[FlexibleRobot | None, Finding | None]:
    """The robot asked for, or else the campaign's; what is wrong with the campaign's own."""
    from picchio.core.errors import InputError
    from picchio.prediction.quality import Finding
    from picchio.robot import load_robot

    name = robot or campaign.robot
    if name is None:
        if flex is not None or tool is not None:
            raise InputError("needs a robot", key="--flex" if flex is not None else "--tool",
                             hint="name it with --robot")  # fmt: skip
        return None, None
    try:
        return load_robot(name, flex=flex, tool=tool or campaign.tool), None
    except InputError as error:
        if robot is not None or flex is not None or tool is not None:
            raise
        return None, Finding(
            "robot",
            "error",
            f"the campaign's robot cannot be used: {error}",
            "correct `robot` or `tool` in campaign.toml, or give another with --robot; what needs "
            "a robot was not checked",
        )
