"""`picchio identify`: the values that a diagnosis found, written back as a sidecar."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from picchio.cli.options import FlexOption, JsonOption, RobotArgument, ToolOption
from picchio.core.errors import InputError

EPILOG = (
    "Example: picchio identify kuka_kr300_r2500 --data motions/ --out identified.toml, "
    "then picchio assess kuka_kr300_r2500 --flex identified.toml"
)


def register(app: typer.Typer) -> None:
    """Add the subcommand."""
    app.command(epilog=EPILOG)(identify)


def identify(
    robot: RobotArgument,
    data: Annotated[
        Path, typer.Option("--data", metavar="CAMPAIGN", help="Folder with a campaign.toml.")
    ],
    out: Annotated[Path, typer.Option("--out", metavar="SIDECAR.toml", help="What to write.")],
    flex: FlexOption = None,
    tool: ToolOption = None,
    json: JsonOption = None,
) -> None:
    """Write the extended model's values back as a sidecar, with their source and uncertainty."""
    import picchio
    from picchio.cli.output import check_target, console, say_warning, telling, write_json
    from picchio.core.files import atomic_write

    if str(out) == "-":
        raise InputError("must be a file", key="--out", value=str(out))
    check_target(out, [flex])
    check_target(json, [flex, out])
    campaign = picchio.load_campaign(data)
    moves = any(record.kind == "motion" for record in campaign)
    loaded = picchio.load_robot(robot, flex=flex, tool=tool, allow_rigid=moves)
    for target in (out, json):
        check_target(target, [*loaded.files, *campaign.files])
    with telling() as say:
        found = picchio.identify(loaded, campaign, progress=say)
    text = found.sidecar_text()
    with atomic_write(out) as stream:
        stream.write(text)
    verdict = found.diagnosis.verdict
    if verdict in ("partial", "ambiguous"):
        say_warning(f"the diagnosis is {verdict!r}: look at picchio diagnose, too")
    if json is not None:
        write_json(found.to_dict(), json)
    if json != "-":
        console().print(f"{len(found.diagnosis.causes)} causes; wrote {out}")
