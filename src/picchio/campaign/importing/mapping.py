"""The mapping from a file's series to the contract's channels: `picchio-mapping/1`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from picchio.campaign.tables import FreeTable
from picchio.core.toml import Finite, Positive, StrictModel, parse_toml

FORMAT = "picchio-mapping/1"
FileKind = Literal["csv", "uff", "mcap", "matlab"]


def _one_letter(value: str) -> str:
    if len(value) != 1:
        raise ValueError("must be one letter")
    return value


class SourceTable(StrictModel):
    """`[source]`: how the file is written; all but `kind` is for CSV.

    Attributes:
        kind: as the file's ending says where absent.
        delimiter: between columns.
        decimal: "." or ",".
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
        rate: Hz; the clock where there is no series, or the rate to resample to.
        zero: s; this time of the file becomes t = 0 (the first edge of the first blow). The
            first sample of a rate, and of UFF or MCAP, is counted as the format says.
        resample: "linear" puts stamps that are not even onto an even clock of `rate`.
        stamp: MCAP: the message header's stamp, or the time it was logged.
    """

    series: str | None = None
    unit: str = "s"
    rate: Positive | None = None
    zero: Finite = 0.0
    resample: Literal["linear"] | None = None
    stamp: Literal["header", "log"] = "header"


class ChannelTable(StrictModel):
    """One `[[channel]]`: value = sign * (scale * stored + offset), in `unit`.

    Attributes:
        series: the file's name of it (`from` in the file).
        to: the contract's channel.
        unit: of the value; as the file says, else the contract's, where absent.
        scale, offset, sign: as above.
        remove: subtract the mean of the record ("mean") or of t < 0 ("quiet"), as the
            contract wants of an accelerometer, or of all channels of a steady record.
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
        channel: what becomes what.
        record: the `[[record]]` keys of the campaign: kind, pose, direction, ...
        campaign: its other keys: robot, tool, excitation, ...
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
