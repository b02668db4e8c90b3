"""`picchio import`: files of other formats into a campaign."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from picchio.cli.options import JsonOption

EPILOG = (
    "Example: picchio import run.mcap --write-mapping mapping.toml, edit it, then "
    "picchio import run.mcap --mapping mapping.toml --to campaign"
)


def register(app: typer.Typer) -> None:
    """Add the subcommand."""
    app.command("import", epilog=EPILOG)(import_)


def import_(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", help="UFF 58, MCAP (ROS 2), MATLAB .mat or CSV.", show_default=False
        ),
    ],
    to: Annotated[
        Path | None,
        typer.Option("--to", metavar="CAMPAIGN", help="The campaign's folder."),
    ] = None,
    mapping: Annotated[
        Path | None,
        typer.Option("--mapping", metavar="FILE", help="What the file's series become (TOML)."),
    ] = None,
    write_mapping: Annotated[
        Path | None,
        typer.Option(
            "--write-mapping", metavar="FILE", help="Write a mapping to edit, and stop there."
        ),
    ] = None,
    name: Annotated[
        str | None,
        typer.Option("--name", metavar="R.csv", help="The record's name (.csv or .parquet)."),
    ] = None,
    append: Annotated[
        bool, typer.Option("--append", help="Add the record to the campaign that stands there.")
    ] = False,
    json: JsonOption = None,
) -> None:
    """Import a file as a record of a campaign; the mapping is kept beside it as mapping.toml."""
    import picchio
    from picchio.campaign.importing.importer import read_raw
    from picchio.campaign.importing.template import mapping_template
    from picchio.cli.output import check_target, write_json
    from picchio.core.errors import InputError
    from picchio.core.files import atomic_write

    if write_mapping is not None:
        if to is not None or mapping is not None:
            raise InputError("stands alone: edit the mapping, then import", key="--write-mapping")
        if write_mapping.exists():
            raise InputError("exists already and is left alone", file=write_mapping)
        template = mapping_template(read_raw(file))
        with atomic_write(write_mapping) as stream:
            stream.write(template)
        typer.echo(f"{write_mapping}: edit it, then give it with --mapping", err=True)
        return
    if to is None:
        raise InputError("say where the campaign goes", key="--to")
    check_target(json, [file, mapping])
    made = picchio.import_record(file, to, mapping, name=name, append=append)
    if json is not None:
        write_json(made.to_dict(), json)
    record = made.record
    text = f"{to}: {record.file}, {record.clock.samples} samples at {record.clock.rate:.6g} Hz, "
    typer.echo(text + ", ".join(record.channels), err=json == "-")
