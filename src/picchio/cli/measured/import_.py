"""`picchio import`: files of other formats into a campaign."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from picchio.cli.app import app
from picchio.cli.options import JsonOption
from picchio.cli.output import check_targets, console, deliver
from picchio.core.errors import InputError


@app.command(
    "import",
    epilog="Example: picchio import run.mcap --write-mapping mapping.toml, edit it, then "
    "picchio import run.mcap --mapping mapping.toml --to campaign",
)
def import_(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="UFF 58, MCAP (ROS 2), MATLAB .mat or CSV.")
    ],
    to: Annotated[
        Path | None, typer.Option(metavar="CAMPAIGN", help="The folder of the campaign.")
    ] = None,
    mapping: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Which channels the file's series become (TOML)."),
    ] = None,
    write_mapping: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Write a mapping that lists the file's series, to edit, and stop there.",
        ),
    ] = None,
    name: Annotated[
        str | None, typer.Option(metavar="R.csv", help="The record's name (.csv or .parquet).")
    ] = None,
    append: Annotated[
        bool, typer.Option("--append", help="Add the record to a campaign that is there.")
    ] = False,
    json: JsonOption = None,
) -> None:
    """Import a measured file as a record of a campaign.

    The mapping is kept in the campaign's folder as mapping.toml.
    """
    import picchio

    if write_mapping is not None:
        from picchio.campaign.importing import template

        if to is not None or mapping is not None:
            raise InputError("stands alone: edit the mapping, then import", key="--write-mapping")
        check_targets([write_mapping], [file])
        template.write_mapping(file, write_mapping)
        return
    if to is None:
        raise InputError("say where the campaign goes", key="--to")
    check_targets([json], [file, mapping], folder=to)
    made = picchio.import_record(file, to, mapping, name=name, append=append)
    channels = ", ".join(made.record.channels)
    deliver(made.to_dict(), json, lambda: console().print(f"{made._headline()}, {channels}"))
