"""A foreign file and its mapping become a record."""

from __future__ import annotations

from pathlib import Path
from types import MappingProxyType

import numpy as np

from picchio.campaign.campaign import Campaign
from picchio.campaign.channels import TIME, parse_channel
from picchio.campaign.importing import read_csv, read_matlab, read_mcap, read_uff
from picchio.campaign.importing.mapping import ChannelTable, Mapping
from picchio.campaign.importing.raw import RawChannel, RawFile, Reader
from picchio.campaign.importing.resample import common_clock
from picchio.campaign.record import Record
from picchio.campaign.units import conversion
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError

READERS: MappingProxyType[str, Reader] = MappingProxyType(
    {"csv": read_csv.read, "uff": read_uff.read, "mcap": read_mcap.read, "matlab": read_matlab.read}
)
_ENDINGS = {".csv": "csv", ".txt": "csv", ".tsv": "csv", ".uff": "uff", ".unv": "uff",
            ".mcap": "mcap", ".mat": "matlab"}  # fmt: skip


def read_raw(path: str | Path, mapping: Mapping | None = None) -> RawFile:
    """The series of a foreign file.

    Raises:
        InputError: missing, of an unknown kind, or not readable.
    """
    source = Path(path)
    if not source.is_file():
        raise InputError("no such file", file=source)
    kind = (mapping.source.kind if mapping else None) or _ENDINGS.get(source.suffix.lower())
    if kind is None:
        raise InputError("the kind of file is not known by its ending", file=source,
                         value=source.suffix, choices=_ENDINGS,
                         hint="or say [source] kind in the mapping")  # fmt: skip
    return READERS[kind](source, mapping)


def import_record(
    path: str | Path, mapping: Mapping, *, file: str | None = None, mapping_file: Path | None = None
) -> Campaign:
    """Read a foreign file as a campaign of one record, in memory.

    Args:
        path: the file.
        mapping: what its series become.
        file: the record's name; the file's own with .csv where None.
        mapping_file: for messages.

    Raises:
        InputError: the file can't be read, or the mapping does not fit it.
    """
    raw = read_raw(path, mapping)
    series = _mapped(raw, mapping, mapping_file)
    time, values = _clocked(raw, mapping, series, mapping_file)
    channels, units = {}, {}
    for entry, stored in zip(mapping.channel, values, strict=True):
        if entry.to in channels:
            raise InputError("two series become this channel", file=mapping_file, key=entry.to)
        channels[entry.to], units[entry.to] = _converted(
            entry, raw.channels[entry.series], stored, time, mapping_file
        )
    table = dict(mapping.record)
    if raw.taken is not None:
        table.setdefault("time", raw.taken)
    name = file or f"{Path(path).stem}.csv"
    try:
        record = Record.from_arrays(name, time, channels, units=units, **table)
        campaign = Campaign.from_records([record], **_campaign_keys(mapping))
    except InputError as error:
        if error.file is not None:
            raise
        raise InputError(str(error), file=mapping_file or path) from None
    record.check_samples()
    return campaign


def _campaign_keys(mapping: Mapping) -> dict[str, object]:
    return {str(key): value for key, value in mapping.campaign.items()}


def _mapped(raw: RawFile, mapping: Mapping, file: Path | None) -> list[RawChannel]:
    return [
        raw.channel(entry.series, mapping=file, key=f"channel[{i}].from")
        for i, entry in enumerate(mapping.channel)
    ]


def _clocked(
    raw: RawFile, mapping: Mapping, series: list[RawChannel], file: Path | None
) -> tuple[FloatArray, list[FloatArray]]:
    """One clock for all series, and their values on it."""
    time = mapping.time
    if time.series is not None:
        clock = raw.channel(time.series, mapping=file, key="time.series").values
        try:
            _, convert = conversion(time.unit, ("s",))
        except InputError as error:
            raise InputError(error.problem, file=file, key="time.unit", value=time.unit,
                             choices=error.choices) from None  # fmt: skip
        own: list[FloatArray | None] = [convert(clock)] * len(series)
    elif time.rate is not None and any(s.time is None for s in series):
        own = [np.arange(s.values.size) / time.rate for s in series]
    else:
        own = [s.time for s in series]
    stamps: list[FloatArray] = []
    for entry, stamp in zip(series, own, strict=True):
        if stamp is None:
            raise InputError("this file has no clock of its own", file=file, key="time",
                             hint="give [time] series (which holds the time) or rate")  # fmt: skip
        if stamp.size != entry.values.size:
            raise InputError(f"has {entry.values.size} samples and its clock {stamp.size}",
                             file=raw.path, key=entry.name)  # fmt: skip
        stamps.append(stamp)
    clock, values = common_clock(
        stamps, series, rate=time.rate, resample=time.resample is not None, file=raw.path
    )
    return (clock - time.zero if time.zero else clock), values


def _converted(
    entry: ChannelTable, raw: RawChannel, values: FloatArray, time: FloatArray, file: Path | None
) -> tuple[FloatArray, str]:
    """The mapped values in SI, sign * (scale * stored + offset), and their SI unit."""
    try:
        channel, convert = parse_channel(entry.to, entry.unit or raw.unit)
    except InputError as error:
        shown = {} if error.value is None else {"value": error.value}
        raise InputError(error.problem, file=file, key=f"{entry.series} -> {entry.to}",
                         choices=error.choices, hint=error.hint, **shown) from None  # fmt: skip
    if channel.name == TIME:
        raise InputError("the time is no channel; see [time]", file=file, key=entry.to)
    if entry.scale != 1.0:
        values = values * entry.scale
    if entry.offset != 0.0:
        values = values + entry.offset
    values = convert(values if entry.sign == 1 else -values)
    if entry.remove is not None:
        chosen = values[time < 0.0] if entry.remove == "quiet" else values
        if not chosen.size:
            raise InputError("there is no time before zero to take the rest value from",
                             file=file, key=f"{entry.to}.remove", value="quiet")  # fmt: skip
        values = values - chosen.mean()
    return values, channel.unit
