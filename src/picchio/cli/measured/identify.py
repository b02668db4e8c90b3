"""`picchio identify`: the values that a diagnosis found, written back as a sidecar."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from picchio.cli.app import app
from picchio.cli.options import (
    DataOption,
    FlexOption,
    JsonOption,
    ReducersOption,
    RobotArgument,
    ToolOption,
)
from picchio.cli.output import (
    check_targets,
    console,
    count_of,
    deliver,
    say_warning,
    telling,
)
from picchio.core.errors import InputError
from picchio.core.files import write_text


@app.command(
    epilog="Example: picchio identify kuka_kr300_r2500 --data motions/ --out identified.toml, "
    "then picchio assess kuka_kr300_r2500 --flex identified.toml"
)
def identify(
    robot: RobotArgument,
    data: DataOption,
    out: Annotated[Path, typer.Option(metavar="SIDECAR.toml", help="Where the sidecar goes.")],
    flex: FlexOption = None,
    tool: ToolOption = None,
    reducers: ReducersOption = None,
    json: JsonOption = None,
) -> None:
    """Stiffness and damping from measured data, as a sidecar.

    The values are those of the extended model that `picchio diagnose` finds, each with its source
    and its uncertainty.
    """
    import picchio

    if str(out) == "-":
        raise InputError("must be a file", key="--out", value=str(out))
    check_targets((out, json), [flex])
    campaign = picchio.load_campaign(data)
    moves = any(record.kind == "motion" for record in campaign)
    loaded = picchio.load_robot(
        robot, flex=flex, tool=tool, reducers=reducers or (), allow_rigid=moves
    )
    files = [*loaded.files, *campaign.files]
    check_targets([out], files)
    check_targets([json], [*files, out])
    with telling("reading the data") as say:
        found = picchio.identify(loaded, campaign, progress=say)
    write_text(out, found.sidecar_text())
    verdict, causes = found.diagnosis.verdict, found.diagnosis.causes
    if verdict in ("partial", "ambiguous"):
        say_warning(f"the diagnosis is {verdict!r}: look at picchio diagnose, too")
    deliver(
        found.to_dict(),
        json,
        lambda: console().print(f"{count_of(len(causes), 'cause')} found."),
    )
