"""The mapping from a file's series to the contract's channels: `picchio-mapping/1`."""

from __future__ import annotations

import re
from datetime import datetime
from pathlib import Path
from typing import Annotated, Literal, get_args

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from picchio.campaign.tables import FreeTable, SampleRate
from picchio.core.arrays import BoolArray, FloatArray
from picchio.core.tables import TextLayout
from picchio.core.toml import Finite, FiniteVector, Positive, StrictModel, parse_toml

FORMAT = "picchio-mapping/1"
FileKind = Literal["csv", "uff", "mcap", "matlab", "parquet", "bag", "lvm", "npz", "json-lines"]
KINDS: tuple[FileKind, ...] = get_args(FileKind)
_BRIDGE = re.compile(r"bridge (\d+\.?\d*|\.\d+) ?(|m|u)s")


class SourceTable(TextLayout):
    """`[source]`: how the file is written; all but `kind` is for tables of text.

    Where no key but `kind` and `encoding` is given, the layout is told from the first lines.

    Attributes:
        kind: of file; told by its ending where left out.
    """

    kind: FileKind | None = None

    @property
    def layout(self) -> TextLayout | None:
        """How a table is written; None where the mapping does not say it."""
        return self if self.model_fields_set - {"kind", "encoding"} else None


def _gaps(value: str) -> str:
    if value not in ("split", "refuse") and not _BRIDGE.fullmatch(value):
        raise ValueError('must be "split", "refuse" or "bridge" and a time, such as "bridge 20ms"')
    return value


Moment = datetime | Finite
"""A date and time (UTC where it has no zone), or s in the file's own time."""


class TimeTable(StrictModel):
    """`[time]`: where the clock comes from.

    Attributes:
        series: the series that holds the time, also one of a `[[join]]`; found by its name where
            neither it nor `rate` is given and the file has no clock of its own.
        unit: of the series: s, ms, us, ns, min, h, days, "100 ns", or from a date: "days since
            1899" (spreadsheets), "days since year 0" (MATLAB), "100 ns since 1601" (Windows), "100
            ns since year 1" (.NET); told by the name, or by the size of the stamps, where left
            out. Dates as text need none.
        rate: Hz, sample rate where there is no time series, or the rate to resample to.
        zero: s, the time in the file that becomes t = 0 (the first edge of the first blow). With
            `rate` alone the first sample is at 0; UFF and MCAP files state the time of theirs;
            stamps that count from 1970 begin at 0 where no zero is given.
        resample: "linear" interpolates uneven time stamps onto an even clock of `rate`.
        stamp: MCAP and bags: the message header's stamp, or the time it was logged.
        gaps: "split" makes a record of each stretch between dropouts, "refuse" takes none,
            "bridge 20ms" draws straight lines over those up to so long.
        start: when a clock that does not count from 1970 was at zero.
        begin, end: s, or a date and time: what lies before or after is left out.
    """

    series: str | None = None
    unit: str | None = None
    rate: SampleRate | None = None
    zero: Finite = 0.0
    resample: Literal["linear"] | None = None
    stamp: Literal["header", "log"] = "header"
    gaps: Annotated[str, AfterValidator(_gaps)] = "split"
    start: datetime | None = None
    begin: Moment | None = None
    end: Moment | None = None

    @property
    def bridge(self) -> float:
        """s, the longest gap over which straight lines are drawn; 0 for none."""
        found = _BRIDGE.fullmatch(self.gaps)
        return 0.0 if found is None else float(found[1]) * {"": 1.0, "m": 1e-3, "u": 1e-6}[found[2]]


class FilterTable(StrictModel):
    """One `[[filter]]`: only samples at which a series lies within bounds are taken.

    Attributes:
        series: of the file.
        least: 1, smallest value, as stored.
        most: 1, largest value, as stored.
    """

    series: str
    least: Finite | None = None
    most: Finite | None = None

    def passes(self, values: FloatArray) -> BoolArray:
        """(m,) which samples lie within the bounds.

        Args:
            values: (m,) of the series, as stored.
        """
        low = -np.inf if self.least is None else self.least
        return np.asarray(
            (values >= low) & (values <= (np.inf if self.most is None else self.most))
        )


class CouplingTable(StrictModel):
    """One `[[coupling]]`: joints of the URDF, value = matrix (a controller's axes) + offset.

    Attributes:
        kind: of the channels: position, motor_position, velocity, torque, ...
        joints: of the URDF, one a row of the matrix.
        series: of the file, one a column.
        matrix: 1, a row a joint: [0, -1, -1] is minus the second axis minus the third.
        offset: 1, added to each joint, in `unit`.
        unit: of the series; the file's, or else the channel's SI unit, where left out.
    """

    kind: str = "position"
    joints: list[str] = Field(min_length=1)
    series: list[str] = Field(alias="from", min_length=1)
    matrix: list[list[Finite]]
    offset: list[Finite] | None = None
    unit: str | None = None

    @model_validator(mode="after")
    def _shaped(self) -> CouplingTable:
        rows, columns = len(self.joints), len(self.series)
        if len(self.matrix) != rows or any(len(row) != columns for row in self.matrix):
            raise ValueError(f"the matrix must have {rows} rows of {columns} numbers")
        if self.offset is not None and len(self.offset) != rows:
            raise ValueError(f"the offset must have {rows} numbers")
        return self


class JoinTable(StrictModel):
    """One `[[join]]`: another file of the same time; its series are named "<name>:<series>".

    Attributes:
        name: before the colon.
        file: relative to the first one; {stem} stands for the first one's name without ending.
        source: how it is written.
        time: its clock; `series`, `unit`, `rate`, `stamp` and `start` count.
        shift: s, added to its clock.
    """

    name: Annotated[str, Field(min_length=1)]
    file: Annotated[str, Field(min_length=1)]
    source: SourceTable = SourceTable()
    time: TimeTable = TimeTable()
    shift: Finite = 0.0


class ChannelTable(StrictModel):
    """One `[[channel]]`: value = sign * (scale * stored + offset), in `unit`.

    Attributes:
        series: name of the series in the file.
        to: the channel, such as "accelerometer.tool.x"; `picchio formats record` lists them.
        unit: of the value; where left out, the file's, or else the channel's SI unit.
        scale: 1, factor on the stored number.
        offset: 1, added after the factor, in `unit`.
        sign: 1 or -1, factor on the result.
        remove: subtract the mean of the whole record ("mean", for a steady record) or of the quiet
            time t < 0 ("quiet", for an accelerometer).
    """

    series: str = Field(alias="from")
    to: str
    unit: str | None = None
    scale: Finite = 1.0
    offset: Finite = 0.0
    sign: Literal[1, -1] = 1
    remove: Literal["mean", "quiet"] | None = None


class BlowsTable(StrictModel):
    """`[blows]`: how `picchio count` finds blows in the channels.

    Attributes:
        threshold: N (m/s^2 of an accelerometer, the channel's unit of a trigger), a blow exceeds
            it; a fifth of the task's force where left out.
        foot: N, as the threshold: below it a blow is over; a tenth of the threshold where left out.
        direction: 1, of the tool's force on the robot, where one channel holds it.
        frame: the direction's axes, and those of `force.x`, `.y`, `.z`: "tool" turns with the tool
            frame.
        trigger: the channel `trigger` is above the threshold while the tool works ("on"), or
            passes it at each blow ("blow").
        operation: of the task: whose blows are assumed where none are seen.
        pose: rad or m, of the robot's joints in their order, where the log has no angles.
    """

    threshold: Positive | None = None
    foot: Positive | None = None
    direction: FiniteVector | None = None
    frame: Literal["tool", "world"] = "tool"
    trigger: Literal["on", "blow"] = "on"
    operation: str | None = None
    pose: list[Finite] | None = None


class Mapping(StrictModel):
    """A mapping file.

    Attributes:
        source: how the file is written.
        time: its clock.
        channel: which series becomes which channel, one table for each.
        coupling: joints whose angles follow from several of the controller's axes.
        filter: which samples are taken; all of them must hold.
        join: other files of the same time.
        record: keys of the campaign's `[[record]]`: kind, pose, direction, ...
        campaign: the campaign's other keys: robot, tool, excitation, ...
        blows: how `picchio count` finds blows; no import uses it.
    """

    source: SourceTable = SourceTable()
    time: TimeTable = TimeTable()
    channel: list[ChannelTable] = Field(default_factory=list)
    coupling: list[CouplingTable] = Field(default_factory=list)
    filter: list[FilterTable] = Field(default_factory=list)
    join: list[JoinTable] = Field(default_factory=list)
    record: FreeTable = Field(default_factory=dict)
    campaign: FreeTable = Field(default_factory=dict)
    blows: BlowsTable | None = None

    @model_validator(mode="after")
    def _something(self) -> Mapping:
        if not self.channel and not self.coupling:
            raise ValueError("needs a [[channel]] or a [[coupling]] without a # before it")
        return self

    @property
    def entries(self) -> list[tuple[str, str, dict[str, float], ChannelTable]]:
        """What becomes of which series: its key in the file, {series: factor}, how it is taken."""
        found = [
            (f"channel[{i}].from", {entry.series: 1.0}, entry)
            for i, entry in enumerate(self.channel)
        ]
        for i, table in enumerate(self.coupling):
            offsets = table.offset or [0.0] * len(table.joints)
            for joint, row, offset in zip(table.joints, table.matrix, offsets, strict=True):
                parts = {s: f for s, f in zip(table.series, row, strict=True) if f}
                entry = ChannelTable(
                    series=table.series[0], to=f"{table.kind}.{joint}", unit=table.unit,
                    offset=offset,
                )  # fmt: skip
                found.append((f"coupling[{i}].from", parts or {table.series[0]: 0.0}, entry))
        return [(key, entry.to, parts, entry) for key, parts, entry in found]


UNSAID = Mapping.model_construct()
"""What holds of a file of which nothing is known."""


def read_mapping(path: str | Path) -> Mapping:
    """Read a mapping file.

    Raises:
        InputError: missing, no TOML, unknown keys, wrong values.
    """
    return parse_toml(path, Mapping, format=FORMAT)
