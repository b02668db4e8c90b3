"""A mapping to start from: every series of a file, with its channel where its name says it."""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np

from picchio.campaign.channels import LOG_KINDS, patterns
from picchio.campaign.importing.detect import clock, rate_and_gaps
from picchio.campaign.importing.importer import read_raw
from picchio.campaign.importing.mapping import FORMAT, TimeTable
from picchio.campaign.importing.named import Named, accelerometers, named
from picchio.campaign.importing.raw import RawChannel, RawFile
from picchio.campaign.importing.resample import clocked
from picchio.core.errors import InputError
from picchio.core.files import write_text
from picchio.core.tables import TextLayout, sniffed


@dataclass(frozen=True)
class Answers:
    """What no file tells, and a person was asked.

    Attributes:
        robot: its name or URDF.
        frame: that the accelerometer is fixed to.
        unit: of its readings, where the file does not tell it.
        start: when the clock was at zero.
        pose: rad or m, where the robot stood.
        threshold: m/s^2, what the accelerometer reads more than in a blow.
    """

    robot: str | None = None
    frame: str | None = None
    unit: str | None = None
    start: datetime | None = None
    pose: tuple[float, ...] | None = None
    threshold: float | None = None


def write_mapping(
    file: str | Path,
    out: str | Path,
    joints: Collection[str] | None = None,
    frames: Collection[str] | None = None,
    answers: Answers = Answers(),
) -> list[Named]:
    """Write a mapping to start from, for a file that is to be imported.

    Args:
        file: to be imported.
        out: where the mapping goes; a file that stands there is left alone.
        joints: of the robot; None where it is not known.
        frames: likewise.
        answers: what a person told.

    Returns:
        what the names and units of the series say; the others are left to be filled in.

    Raises:
        InputError: the file cannot be read, or `out` exists or cannot be written.
    """
    if Path(out).exists():
        raise InputError("exists already and is left alone", file=out)
    raw = read_raw(file)
    known = named(raw, joints, frames)
    sensors = accelerometers(raw) if answers.frame else []
    told = {
        entry.series: entry for one in sensors[:1] for entry in one.entries(answers.frame or "")
    }
    known = [
        Named(one.series, mine.to, mine.unit or answers.unit, "as answered")
        if (mine := told.get(one.series)) else one for one in known
    ]  # fmt: skip
    write_text(out, mapping_template(raw, known, answers))
    return known


def mapping_template(
    raw: RawFile, known: Sequence[Named] | None = None, answers: Answers = Answers()
) -> str:
    """The text of a `picchio-mapping/1` file that lists the series.

    Those whose names and units say what they are stand ready, the others are commented out.

    Args:
        raw: as `read_raw` gives it.
        known: as `named` gives it; it is asked without a robot where None.
        answers: what a person told.
    """
    start = answers.start and f"start = {answers.start.isoformat()}   # when the clock was at zero"
    robot = answers.robot and f"robot = {_quoted(answers.robot)}"
    blows = {
        "threshold": (answers.threshold, "m/s^2: a fifth of the largest reading"),
        "pose": (answers.pose and list(answers.pose), "rad or m, where the log has none"),
    }
    told_blows = [f"{key} = {value}   # {why}" for key, (value, why) in blows.items() if value]
    told_of = {one.series: one for one in (named(raw) if known is None else known)}
    times, told = _time(raw)
    lines = [
        f"# What the series of {raw.path.name} become; see picchio import --help.",
        *(f"# detected: {line}" for line in told),
        f'format = "{FORMAT}"',
        "",
        "[source]",
        f'kind = "{raw.kind}"',
        *(_layout(raw) if raw.kind == "csv" else ()),
        "",
        "[time]",
        *times,
        *([start] if start else []),
        "# zero = 0.0               # s: this time becomes t = 0, the first edge of the first blow",
        "",
        "[record]                   # the keys of a campaign's [[record]]",
        'kind = "percussion"        # or "motion"',
        "# pose = { joint_1 = 0.0 }  # rad",
        "# direction = [1.0, 0.0, 0.0]",
        "# hits = 12",
        "",
        "[campaign]                 # the keys of campaign.toml",
        robot or '# robot = "fanuc_like_3dof"',
        "# excitation = { kind = 'pulse_train', force = 300.0, period = 0.040, width = 0.004 }",
        "",
        ("" if told_blows else "# ")
        + "[blows]                  # for picchio count; else the task's",
        *(told_blows or ["# threshold = 100.0        # N; of an acceleration m/s^2"]),
        '# operation = "..."        # of the task, where it has several',
        '# frame = "tool"           # or "world": the axes of force.x, .y, .z',
        "",
        "# Channels: "
        + ", ".join(patterns())
        + "; for picchio count also "
        + ", ".join(kind.pattern for kind in LOG_KINDS),
        "# value = sign * (scale * stored + offset), in unit",
    ]
    for channel in raw.channels.values():
        lines += ["", *_channel(channel, told_of.get(channel.name))]
    return "\n".join(lines) + "\n"


def _layout(raw: RawFile) -> list[str]:
    found = sniffed(raw.path)[0]
    usual = dict(TextLayout(encoding="utf-8-sig")) | {"delimiter": "", "decimal": ""}
    return [f"{key} = {_quoted(value)}" for key, value in found if value != usual[key]]


def _time(raw: RawFile) -> tuple[list[str], tuple[str, ...]]:
    """The lines of `[time]`, and what was detected."""
    offered = [
        '# resample = "linear"      # where stamps are uneven or series have their own; then',
        "# rate = ...               # Hz",
        '# gaps = "bridge 20ms"     # draws lines over gaps of up to 20 ms; else "split"',
    ]
    own = [channel.time for channel in raw.channels.values() if channel.time is not None]
    if own and raw.clock is None:
        return ["# the file's own stamps are used", *offered], raw.told
    try:
        found = None if own else clock(raw)
        made = clocked(raw, TimeTable(), names=None)
        told, rate = made.told, _rate(made)
        if rate:
            offered[1] = f"# rate = {rate}".ljust(27) + "# Hz: as the stamps come"
    except InputError as error:
        told = (*raw.told, f"the clock is not taken: {error.problem}")
    if raw.clock is not None:
        return [f"series = {_quoted(raw.clock)}", *offered], told
    if found is None:
        return ['# series = "..."           # which holds the time; or',
                "# rate = ...               # Hz: no series is named as a time, so it must be said",
                ], told  # fmt: skip
    lines = [f"series = {_quoted(found.series)}", f'unit = "{found.unit}"   # {found.why}']
    return [*lines, *offered], told


def _rate(raw: RawFile) -> str:
    """The rate of the first series, Hz."""
    time = next(iter(raw.channels.values())).time
    if time is None or time.size < 2:
        return ""
    rate = rate_and_gaps(np.rint((time - time[0]) * 1e9).astype(np.int64))[0]
    return f"{rate:.6g}" if "e" in f"{rate:.6g}" else f"{float(f'{rate:.6g}')}"


def _channel(channel: RawChannel, known: Named | None) -> list[str]:
    if known is None:
        return [f"# {channel.values.size} stamps: the time", f"# from = {_quoted(channel.name)}"]
    finite = channel.values[np.isfinite(channel.values)] if channel.values.size else channel.values
    low, high = (finite.min(), finite.max()) if finite.size else (math.nan, math.nan)
    about = f"# {channel.values.size} samples, {low:.6g} to {high:.6g}"
    note = f" ({channel.note})" if channel.note else ""
    why = f"; {known.why}" if known.why else ""
    lines = ["[[channel]]", f"from = {_quoted(channel.name)}"]
    if known.to:
        lines.append(f"to = {_quoted(known.to)}")
        return [
            about + note + why,
            *lines,
            *(["unit = " + _quoted(known.unit)] if known.unit else []),
        ]
    lines += [f"to = {_quoted(channel.suggestion or '...')}",
              f"unit = {_quoted(channel.unit or known.unit or '...')}"]  # fmt: skip
    return [about + note + why, *(f"# {line}" for line in lines)]


def _quoted(value: str | bool | int) -> str:
    """A value as TOML writes it."""
    return json.dumps(value, ensure_ascii=False)
