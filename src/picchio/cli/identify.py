"""`picchio identify`: the values that a diagnosis found, written back as a sidecar."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from picchio.cli.options import FlexOption, JsonOption, RobotArgument, ToolOption
from picchio.core.errors import InputError

if TYPE_CHECKING:
    from picchio.campaign.campaign import Campaign
    from picchio.diagnosis.result import Diagnosis
    from picchio.robot.flexible_robot import FlexibleRobot

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
    from picchio.campaign.campaign import load_campaign
    from picchio.cli.output import check_target, console, say_warning, write_json
    from picchio.core.provenance import provenance
    from picchio.diagnosis.motion.conclude.identified import identified_sidecar
    from picchio.robot.loading.load import load_robot

    if str(out) == "-":
        raise InputError("must be a file", key="--out", value=str(out))
    check_target(out, [flex])
    check_target(json, [flex, out])
    campaign = load_campaign(data)
    moves = any(record.kind == "motion" for record in campaign)
    loaded = load_robot(robot, flex=flex, tool=tool, allow_rigid=moves)
    for target in (out, json):
        check_target(target, [*loaded.files, *campaign.files])
    diagnosis = _diagnose(loaded, campaign)
    table, remarks = identified_sidecar(loaded, diagnosis, data.resolve().name)
    made = provenance([*loaded.files, *campaign.files])
    _write(table, remarks, diagnosis.verdict, made, out)
    if diagnosis.verdict in ("partial", "ambiguous"):
        say_warning(f"the diagnosis is {diagnosis.verdict!r}: look at picchio diagnose, too")
    if json is not None:
        write_json({**diagnosis.to_dict(), "provenance": made}, json)
    if json != "-":
        console().print(f"{len(diagnosis.causes)} causes; wrote {out}")


def _diagnose(robot: FlexibleRobot, campaign: Campaign) -> Diagnosis:
    """Of motion records where there are any, else of percussion."""
    from picchio.cli.output import progress

    if any(record.kind == "motion" for record in campaign):
        from picchio.diagnosis.motion.diagnosis import diagnose_motion

        with progress("diagnosis") as report:
            return diagnose_motion(robot, campaign, progress=report)
    from picchio.diagnosis.percussion.diagnosis import diagnose_percussion

    return diagnose_percussion(robot, campaign).diagnosis


def _write(table: dict[str, Any], remarks: list[str], verdict: str, made: dict[str, Any],
           out: Path) -> None:  # fmt: skip
    """The sidecar, whole or not at all; what it has no key for stands in comments."""
    import tomlkit

    from picchio.core.files import atomic_write

    document = tomlkit.document()
    document.add(tomlkit.comment(f"Written by picchio {made['picchio']}; verdict: {verdict}."))
    for source in made["inputs"]:
        document.add(tomlkit.comment(f"{source['file']} sha256 {source['sha256']}"))
    document.add(
        tomlkit.comment("Found as well, and no sidecar's:" if remarks else "Nothing else.")
    )
    for line in remarks:
        document.add(tomlkit.comment(f"  {line}"))
    for key, value in table.items():
        document[key] = value
    text = tomlkit.dumps(document)
    with atomic_write(out) as stream:
        stream.write(text)
