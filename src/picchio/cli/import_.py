"""`picchio import`: files of other formats into a campaign."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from picchio.cli.options import JsonOption

if TYPE_CHECKING:
    from picchio.campaign.campaign import Campaign

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
    from picchio.campaign.campaign import write_campaign
    from picchio.campaign.importing.importer import import_record, read_raw
    from picchio.campaign.importing.mapping import read_mapping
    from picchio.campaign.importing.template import mapping_template
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
    if mapping is None:
        if not file.is_file():
            raise InputError("no such file", file=file)
        raise InputError(
            "needs a mapping from its series to the campaign's channels",
            file=file,
            key="--mapping",
            hint=f"`picchio import {file} --write-mapping mapping.toml` writes one to edit",
        )
    new = import_record(file, read_mapping(mapping), file=name, mapping_file=mapping)
    kept = mapping.read_bytes()
    extra = {"mapping.toml": kept}
    if append:
        new, extra = _appended(new, to, kept)
    campaign = write_campaign(
        _with_provenance(new, file, mapping), to, overwrite=append, extra_files=extra
    )
    imported = campaign.records[-1]
    clock = imported.clock
    if json is not None:
        from picchio.cli.output import write_json
        from picchio.core.provenance import provenance

        write_json(
            {
                "format": "picchio-import/1",
                "campaign": str(to),
                "record": imported.file,
                "channels": list(imported.channels),
                "samples": clock.samples,
                "sample_rate": clock.rate,
                "provenance": provenance([file, mapping]),
            },
            json,
        )
    text = f"{to}: {imported.file}, {clock.samples} samples at {clock.rate:.6g} Hz, "
    typer.echo(text + ", ".join(imported.channels), err=json == "-")


def _appended(new: Campaign, to: Path, mapping: bytes) -> tuple[Campaign, dict[str, bytes]]:
    """The campaign at `to` with the new record in it, and the mapping's file."""
    from picchio.campaign.campaign import Campaign, load_campaign
    from picchio.core.errors import InputError

    old = load_campaign(to)
    settings = new.table.model_dump(exclude_none=True, exclude_defaults=True, exclude={"record"})
    standing = old.table.model_dump(exclude_none=True, exclude_defaults=True, exclude={"record"})
    for key, value in settings.items():
        if standing.get(key) != value:
            raise InputError("the mapping says otherwise than the campaign that stands there",
                             file=to, key=key, value=value,
                             hint="what is this record's own belongs under [record]")  # fmt: skip
    if old.robot is not None:
        standing["robot"] = old.robot
    campaign = Campaign.from_records([*old.records, *new.records], **standing)
    first = to / "mapping.toml"
    if first.is_file() and first.read_bytes() != mapping:
        return campaign, {f"{Path(new.records[0].file).stem}.mapping.toml": mapping}
    return campaign, {"mapping.toml": mapping}


def _with_provenance(campaign: Campaign, *inputs: Path) -> Campaign:
    """The campaign with the import noted in its [provenance]."""
    from dataclasses import replace

    from picchio.core.provenance import provenance

    made: dict[str, Any] = provenance(inputs)
    before = (campaign.table.provenance or {}).get("inputs", [])
    found = {
        "picchio": made["picchio"],
        "inputs": [entry for entry in before if entry not in made["inputs"]] + made["inputs"],
    }
    return replace(campaign, table=campaign.table.model_copy(update={"provenance": found}))
