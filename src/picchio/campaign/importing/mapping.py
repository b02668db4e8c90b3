"""The mapping from a file's series to the contract's channels: `picchio-mapping/1`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from picchio.campaign.tables import FreeTable, SampleRate
from picchio.core.toml import Finite, StrictModel, parse_toml

FORMAT = "picchio-mapping/1"
FileKind = Literal["csv", "uff", "mcap", "matlab"]


def _one_letter(value: str) -> str:
    if len(value) != 1:
        raise ValueError("must be one letter")
    return value


class SourceTable(StrictModel):
    """`[source]`: how the file is written; all but `kind` is for CSV.

    Attributes:
        kind: of file; told by its ending where left out.
        delimiter: one letter between columns.
        decimal: sign of decimal numbers.
        skip_lines: lines before the header (or the first sample).
        header: whether a line names the columns; without one they are "1", "2", ...
    """

    kind: FileKind | None = None
    delimiter: Annotated[str, AfterValidator(_one_letter)] = ","
    decimal: Literal[".", ","] = "."
    skip_lines: Annotated[int, Field(ge=0, strict=True)] = 0
    header: bool = True


class TimeTable(StrictModel):
    """`[time]`: where the clock comes from.

    Attributes:
        series: the series that holds the time, in `unit`; not for UFF and MCAP, which have one.
        unit: of the series.
        rate: Hz, sample rate where there is no time series, or the rate to resample to.
        zero: s, the time in the file that becomes t = 0 (the first edge of the first blow). With
            `rate` alone the first sample is at 0; UFF and MCAP files state the time of theirs.
        resample: "linear" interpolates uneven time stamps onto an even clock of `rate`.
        stamp: MCAP only: the message header's stamp, or the time it was logged.
    """

    series: str | None = None
    unit: str = "s"
    rate: SampleRate | None = None
    zero: Finite = 0.0
    resample: Literal["linear"] | None = None
    stamp: Literal["header", "log"] = "header"


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


class Mapping(StrictModel):
    """A mapping file.

    Attributes:
        source: how the file is written.
        time: its clock.
        channel: which series becomes which channel, one table for each.
        record: keys of the campaign's `[[record]]`: kind, pose, direction, ...
        campaign: the campaign's other keys: robot, tool, excitation, ...
    """

    source: SourceTable = SourceTable()
    time: TimeTable = TimeTable()
    channel: list[ChannelTable] = Field(min_length=1)
    record: FreeTable = Field(default_factory=dict)
    campaign: FreeTable = Field(default_factory=dict)


def read_mapping(path: str | Path) -> Mapping:
    """Read a mapping file.

    Raises:
        InputError: missing, no TOML, unknown keys, wrong values.
    """
    return parse_toml(path, Mapping, format=FORMAT)
