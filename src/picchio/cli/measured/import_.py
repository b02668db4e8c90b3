"""`picchio import`: files of other formats into a campaign."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from picchio.cli.app import app
from picchio.cli.options import JsonOption, folder, output
from picchio.cli.output import console, deliver
from picchio.core.errors import InputError


@app.command("import")
def import_(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="CSV of any habit, Parquet, MCAP and .db3 (ROS 2), .bag (ROS 1), UFF 58, MATLAB "
            ".mat, .lvm, .npz or JSON lines (.jsonl).",
        ),
    ],
    to: Annotated[Path | None, folder("--to", "CAMPAIGN", "The folder of the campaign.")] = None,
    mapping: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Which channels the file's series become (TOML)."),
    ] = None,
    write_mapping: Annotated[
        Path | None,
        output(
            "--write-mapping",
            "FILE",
            "Write a mapping that lists the file's series, to edit, and stop there. Series that "
            "are named as channels or joints, with their units, are filled in.",
        ),
    ] = None,
    robot: Annotated[
        str | None,
        typer.Option(
            metavar="ROBOT", help="For --write-mapping: the robot whose joints the series are of."
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

    With FILE alone it tells what the file seems to be: its layout, series, clock, rate and gaps. A
    file with gaps becomes several records. The mapping is kept in the campaign's folder as
    mapping.toml.
    """
    import picchio

    if write_mapping is not None:
        from picchio.campaign.importing import template

        if to is not None or mapping is not None:
            raise InputError("stands alone: edit the mapping, then import", key="--write-mapping")
        model = None if robot is None else picchio.load_robot(robot)
        joints = None if model is None else model.joint_names
        frames = None if model is None else [*model.tree.links, *model.tree.joints]
        known = template.write_mapping(file, write_mapping, joints, frames)
        for one in known:
            if one.to:
                console().print(f"{one.series} is {one.to}: {one.why}")
        left = [one.series for one in known if not one.to]
        if left:
            console().print(f"left to be filled in, if it is needed: {', '.join(left)}")
        return
    if robot is not None:
        raise InputError("is for --write-mapping", key="--robot")
    if to is None and mapping is None:
        from picchio.campaign.importing.importer import detection

        seen = detection(file)
        deliver(seen.to_dict(), json, lambda: console().print("\n".join(seen.told)))
        return
    if to is None:
        raise InputError("say where the campaign goes", key="--to")
    made = picchio.import_record(file, to, mapping, name=name, append=append)
    channels = ", ".join(made.record.channels)

    def show() -> None:
        console().print(f"{made._headline()}, {channels}")
        for line in made.detected:
            console().print(f"  detected: {line}")

    deliver(made.to_dict(), json, show)
