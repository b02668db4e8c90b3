"""`picchio import`: files of other formats into a campaign."""

from __future__ import annotations

import sys
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from picchio.cli.app import app
from picchio.cli.options import JsonOption, ReportOption, folder, output
from picchio.cli.output import console, deliver, to_write, write_report
from picchio.core.errors import InputError

if TYPE_CHECKING:
    from picchio.ledger.first_look import FirstLook


@app.command("import")
def import_(
    file: Path,
    *,
    to: Annotated[Path | None, folder("--to")] = None,
    mapping: Path | None = None,
    write_mapping: Annotated[Path | None, output("--write-mapping")] = None,
    robot: str | None = None,
    name: str | None = None,
    append: bool = False,
    report: ReportOption = None,
    json: JsonOption = None,
) -> None:
    """Import a measured file as a record of a campaign.

    With FILE alone it tells what the file seems to be: its layout, series, clock, rate and gaps; of
    an accelerometer also level, spectrum, blows, and how the structure rings after them. At a
    terminal it then asks for what no file tells, and writes the mapping. A file with gaps becomes
    several records. The mapping is kept in the campaign's folder as mapping.toml.

    Options:
        file (FILE): CSV of any habit, Parquet, MCAP and .db3 (ROS 2), .bag (ROS 1), UFF 58, MATLAB
            .mat, .lvm, .npz or JSON lines (.jsonl).
        to (CAMPAIGN): The folder of the campaign.
        mapping (FILE): Which channels the file's series become (TOML).
        write_mapping (FILE): Write a mapping that lists the file's series, to edit, and stop there.
            Series that are named as channels or joints, with their units, are filled in.
        robot (ROBOT): For --write-mapping: the robot whose joints the series are of.
        name (R.csv): The record's name (.csv or .parquet).
        append: Add the record to a campaign that is there.
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
        from picchio.ledger.first_look import first_look

        seen = first_look(file)
        write_report(seen, report)
        deliver(seen.to_dict(), json, lambda: console().print("\n".join(seen.told)))
        if json != "-" and sys.stdin.isatty():
            _ask(file, seen)
        return
    if report is not None:
        raise InputError("is for FILE alone", key="--report")
    if to is None:
        raise InputError("say where the campaign goes", key="--to")
    made = picchio.import_record(file, to, mapping, name=name, append=append)
    channels = ", ".join(made.record.channels)

    def show() -> None:
        console().print(f"{made._headline()}, {channels}")
        for line in made.detected:
            console().print(f"  detected: {line}")

    deliver(made.to_dict(), json, show)


Answer = TypeVar("Answer")


def _ask(file: Path, seen: FirstLook) -> None:
    """Ask for what no file tells, and write the mapping."""
    from picchio.campaign.importing import template
    from picchio.campaign.importing.named import named
    from picchio.core.units import conversion
    from picchio.robot.loading.load import load_robot

    raw, sensor = seen.detection.raw, seen.vibration and seen.vibration.sensor
    typer.echo("\nWhat no file tells (Enter skips, Ctrl-C writes no mapping):", err=True)
    name, robot = _asked("Robot, as in `picchio robots`, or its URDF",
                         lambda text: (text, load_robot(text))) or (None, None)  # fmt: skip
    joints = None if robot is None else robot.joint_names
    frames = None if robot is None else [*robot.tree.links, *robot.tree.joints]

    def frame_of(text: str) -> str:
        if frames and text not in frames:
            raise InputError("the robot has no such link", value=text, choices=frames)
        return text

    def pose_of(text: str) -> tuple[float, ...]:
        try:
            pose = tuple(float(part) for part in text.split(","))
        except ValueError:
            raise InputError("must be numbers with commas between", value=text) from None
        if len(pose) != len(joints or ()):
            raise InputError("must have a number for each joint", value=text, choices=joints or ())
        return pose

    def moment(text: str) -> datetime:
        try:
            return datetime.fromisoformat(text)
        except ValueError:
            raise InputError("must be a date and time", value=text) from None

    usual = robot.tool_frame if robot else "tool"
    frame = _asked("Link that carries the accelerometer", frame_of, usual) if sensor else None
    unit = None
    if sensor and not sensor.unit:
        unit = _asked("Its unit, such as g", lambda text: conversion(text, ("m/s^2",)) and text)
    stands = any(one.to.startswith("position.") for one in named(raw, joints, frames))
    pose = _asked(f"Where it stood: {', '.join(joints)}, rad or m", pose_of) if (
        joints and not stands) else None  # fmt: skip
    start = None if raw.epoch else _asked("When it began, such as 2026-03-01 08:00 (UTC)", moment)
    out = _asked("Mapping to write", lambda text: to_write(text, "mapping"), f"{file.stem}.toml")
    seen_blows = sensor and sensor.convert and frame and seen.vibration and seen.vibration.threshold
    answers = template.Answers(
        name, frame, unit, start, pose, float(f"{seen_blows:.3g}") if seen_blows else None
    )
    if out is not None:
        template.write_mapping(file, out, joints, frames, answers)
        life = f"picchio count {name} --log {file} --mapping {out} --ledger {file.stem}.ledger"
        typer.echo(f"Next: {life}" if name else f"Next: picchio import {file} --mapping {out} --to "
                   "CAMPAIGN", err=True)  # fmt: skip


def _asked(question: str, read: Callable[[str], Answer], default: str = "") -> Answer | None:
    """The answer to a question, asked until it can be read; None for an empty one."""
    while text := str(typer.prompt(question, default, show_default=bool(default), err=True)):
        try:
            return read(text)
        except InputError as error:
            typer.echo(f"  {error}", err=True)
    return None
