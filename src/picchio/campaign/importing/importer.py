"""A foreign file and its mapping become a record."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from picchio.campaign.campaign import Campaign, load_campaign
from picchio.campaign.channels import TIME, parse_channel
from picchio.campaign.importing.detect import implausible, rising, told
from picchio.campaign.importing.isolated import blocks_isolated, read_isolated
from picchio.campaign.importing.mapping import (
    UNSAID,
    ChannelTable,
    JoinTable,
    Mapping,
    read_mapping,
)
from picchio.campaign.importing.raw import RawChannel, RawFile, below
from picchio.campaign.importing.readers import read_parquet
from picchio.campaign.importing.resample import clocked, common_clock, told_apart
from picchio.campaign.record import Record
from picchio.campaign.tables import CAMPAIGN_FILE
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError, warn_user
from picchio.core.files import locked, regular_file
from picchio.core.provenance import provenance
from picchio.core.results import Result
from picchio.core.tables import read_table, table_blocks
from picchio.core.toml import read_toml

if TYPE_CHECKING:
    import pandas

_READER = "picchio.campaign.importing.readers.read_"
_IN_BLOCKS = ("csv", "parquet", "mcap", "bag")
ENDINGS = {".csv": "csv", ".txt": "csv", ".tsv": "csv", ".dat": "csv", ".uff": "uff",
            ".unv": "uff", ".mcap": "mcap", ".mat": "matlab", ".parquet": "parquet",
            ".bag": "bag", ".db3": "bag", ".lvm": "lvm", ".npz": "npz", ".jsonl": "json-lines",
            ".ndjson": "json-lines", ".json": "json-lines", ".npy": "npz"}  # fmt: skip
_PACKED = {".zst": "zstd -d", ".zstd": "zstd -d", ".gz": "gunzip", ".xz": "unxz", ".zip": "unzip",
           ".bz2": "bunzip2"}  # fmt: skip

# s that an import waits for another one into the same campaign.
_PATIENCE = 60.0
_BLOCK = 1 << 17  # samples


def kind_of(path: Path, mapping: Mapping = UNSAID) -> str:
    """The kind of a foreign file, as the mapping or its ending says.

    Args:
        path: the file.
        mapping: its `[source] kind` counts.

    Raises:
        InputError: neither says.
    """
    first = parts_of(path)[0]
    if tool := _PACKED.get(first.suffix.lower()):
        raise InputError("is packed", file=path, hint=f"unpack it: {tool} {first}")
    kind = mapping.source.kind or ENDINGS.get(first.suffix.lower())
    if kind is None:
        raise InputError("the kind of file is not known by its ending", file=path,
                         value=path.suffix, choices=ENDINGS,
                         hint="or say [source] kind in the mapping")  # fmt: skip
    return kind


def parts_of(path: Path) -> list[Path]:
    """The files of a log: itself, or those of the folder that a ROS 2 bag is, in their order.

    Args:
        path: the file or folder.

    Raises:
        InputError: neither.
    """
    if not path.is_dir():
        return [regular_file(path)]
    found = [p for p in path.iterdir() if p.suffix in (".mcap", ".db3", ".zstd", ".zst")]
    if not found:
        raise InputError("is a folder, not a file", file=path)
    return sorted(found, key=lambda p: (len(p.name), p.name))


def read_raw(path: str | Path, mapping: Mapping = UNSAID) -> RawFile:
    """The series of a foreign file.

    Args:
        path: the file, or the folder of a ROS 2 bag.
        mapping: how it is written, and which time to take.

    Returns:
        all of its series.

    Raises:
        InputError: missing, of an unknown kind, or not readable.
    """
    source = Path(path)
    kind, files = kind_of(source, mapping), parts_of(source)
    clock = mapping.time.model_dump(mode="json")
    if kind == "csv":
        raw = RawFile.of_table(read_table(files[0], mapping.source.layout))
    else:
        raw = _one_log([read_isolated(_reader(kind), f, clock) for f in files])
    return told_apart(_rows(raw, mapping), mapping.time)


def _reader(kind: str) -> str:
    """The module that reads such files, in a process of its own."""
    return _READER + kind.replace("-", "_")


def _one_log(parts: list[RawFile]) -> RawFile:
    """The files of a bag, one after the other in time, as one."""
    first = parts[0]
    channels: dict[str, RawChannel] = {}
    for part in parts if len(parts) > 1 else ():
        late = ((part.epoch or 0) - (first.epoch or 0)) * 1e-9
        for name, c in part.channels.items():
            assert c.time is not None
            before = channels.get(name, replace(c, time=c.time[:0], values=c.values[:0]))
            assert before.time is not None
            channels[name] = replace(c, time=np.append(before.time, c.time + late),
                                     values=np.append(before.values, c.values))  # fmt: skip
    return replace(first, channels=channels or first.channels)


def read_blocks(
    path: Path, mapping: Mapping | None, names: set[str] | None, size: int
) -> Iterator[RawFile]:
    """The series of a log in blocks, so that memory does not grow with it, where its kind allows.

    CSV, Parquet, MCAP, ROS bags; others come as one block.

    Args:
        path: the file.
        mapping: how it is written, which time to take, which rows of a table.
        names: of the series that are needed, all where None; others may be there, too.
        size: samples of a table.

    Raises:
        InputError: as `read_raw`.
    """
    mapping = mapping or UNSAID
    kind, files = kind_of(path, mapping), parts_of(path)
    if kind not in _IN_BLOCKS:
        yield read_raw(path, mapping)
    elif kind == "csv":
        tables = table_blocks(files[0], mapping.source.layout, size)
        yield from _tables(map(RawFile.of_table, tables), mapping, size)
    elif kind == "parquet":
        yield from _tables(read_parquet.blocks(path, size), mapping, size)
    else:
        clock = mapping.time.model_dump(mode="json")
        for file in files:
            yield from blocks_isolated(_reader(kind), file, clock, names)


def _tables(blocks: Iterator[RawFile], mapping: Mapping, size: int) -> Iterator[RawFile]:
    """Blocks of a table, of the rows that pass; of more than one row each, where there are two."""
    before, held = 0, None
    for raw in blocks:
        new = _rows(raw, mapping)
        if held is not None and min(held.rows, new.rows) > 1 and held.rows + new.rows > size:
            yield told_apart(replace(held, before=before), mapping.time)
            before, held = before + held.rows, None
        held = new if held is None else below([held, new])
    if held is not None:
        yield told_apart(replace(held, before=before), mapping.time)


def _rows(raw: RawFile, mapping: Mapping) -> RawFile:
    """The rows of a table that pass the filters, before its clock is asked for.

    Several runs, one below the other, have a clock only each by itself.
    """
    filters = [entry for entry in mapping.filter if entry.series in raw.channels]
    if not filters or not raw.rows or any(c.time is not None for c in raw.channels.values()):
        return raw
    held = np.ones(raw.rows, bool)
    for entry in filters:
        held &= entry.passes(raw.channels[entry.series].values)
    return raw.at(held)


@dataclass(frozen=True, eq=False, repr=False)
class Detection(Result):
    """What a file seems to be.

    Attributes:
        raw: the file.
        lines: a sentence each: layout, clock, rate, gaps.
    """

    LACKS: ClassVar = dict.fromkeys(("plot", "show", "to_frame"), "no record was made yet")

    raw: RawFile
    lines: tuple[str, ...]

    @property
    def told(self) -> tuple[str, ...]:
        """The lines to print, the file's name and series first."""
        names = ", ".join(self.raw.channels)
        head = f"{self._headline()}: {names}"
        return (head, *(f"  {line}" for line in self.lines))

    def _headline(self) -> str:
        return f"{self.raw.path.name}: {self.raw.kind}, {len(self.raw.channels)} series"

    def _content(self) -> dict[str, Any]:
        return {
            "format": "picchio-detection/1",
            "file": self.raw.path,
            "kind": self.raw.kind,
            "detected": list(self.lines),
            "series": [
                {"name": c.name, "samples": c.values.size, "unit": c.unit, "channel": c.suggestion,
                 "rate": None if c.time is None or c.time.size < 2 or np.ptp(c.time) == 0.0 else
                 (c.time.size - 1) / float(np.ptp(c.time))}
                for c in self.raw.channels.values()
            ],
            "left_out": [asdict(one) for one in self.raw.left],
            "provenance": provenance(parts_of(self.raw.path)),
        }  # fmt: skip


def detection(path: str | Path, mapping: Mapping = UNSAID) -> Detection:
    """What a file seems to be: its layout, series, clock, rate and gaps.

    Args:
        path: the file.
        mapping: what is known already.

    Raises:
        InputError: the file can't be read.
    """
    raw = read_raw(path, mapping)
    clocks: dict[bytes, str] = {}
    try:
        raw = clocked(raw, mapping.time)
        lines = list(raw.told)
        for channel in raw.channels.values():
            if channel.time is not None and channel.time.size > 1:
                ns = np.rint(channel.time * 1e9).astype(np.int64)
                if ns.tobytes() in clocks:
                    continue
                ns = ns[rising(ns, raw, channel.name, 1e-9)]
                clocks[ns.tobytes()] = f"{channel.name}: {', '.join(told(ns, False))}"
    except InputError as error:
        hint = f"; {error.hint}" if error.hint else ""
        lines = [*raw.told, f"no clock: {error.problem}{hint}"]
    if not any(line.startswith("rate ") for line in lines):
        lines += clocks.values()
    lines += [own] if (own := _own_record(raw.path)) else []
    return Detection(raw, tuple(lines))


def joined(raw: RawFile, mapping: Mapping, mapping_file: Path | None = None) -> RawFile:
    """The file with its clock, and the files that the mapping joins to it, on one clock.

    Args:
        raw: the first file.
        mapping: its clock, and what is joined.
        mapping_file: for messages.

    Returns:
        the series of all of them, those of a joined file named "<name>:<series>".

    Raises:
        InputError: a file that can't be read, or whose clock does not tell when it was at zero
            while the other's does.
    """
    own = {s for _, _, parts, _ in mapping.entries for s in parts if s in raw.channels}
    own |= {entry.series for entry in mapping.filter if entry.series in raw.channels}
    clock, _, series = (mapping.time.series or "").rpartition(":")
    if table := next((t for t in mapping.join if t.name == clock), None):
        # The stamps stand in another file, a row for a row.
        path, rules = beside(raw.path, mapping, table)
        stamps = read_raw(path, rules).channel(series, mapping=mapping_file, key="time.series")
        stamps = replace(stamps, name=mapping.time.series or "", time=None)
        raw = replace(raw, channels={stamps.name: stamps, **raw.channels})
    first = clocked(raw, mapping.time, mapping_file, own)
    for table in mapping.join:
        if not any(s.startswith(f"{table.name}:") for _, _, p, _ in mapping.entries for s in p):
            continue
        path, rules = beside(raw.path, mapping, table)
        other = clocked(read_raw(path, rules), table.time, mapping_file)
        if (first.epoch is None) != (other.epoch is None):
            raise InputError("one of the two files says when its clock was at zero, the other "
                             "does not", file=path, hint="give its [time] start")  # fmt: skip
        shift = table.shift
        if first.epoch is not None and other.epoch is not None:
            shift += (other.epoch - first.epoch) * 1e-9
        other = called(other, table.name, shift)
        first = replace(first, channels={**first.channels, **other.channels},
                        detected=(*first.detected, *other.detected))  # fmt: skip
    return first


def called(raw: RawFile, name: str, shift: float) -> RawFile:
    """A joined file's series under the names that the mapping has for them.

    Args:
        raw: the file, with its clock.
        name: of the join.
        shift: s, added to its times.
    """
    channels = {
        f"{name}:{key}": replace(
            c, name=f"{name}:{key}", time=None if c.time is None else c.time + shift
        )
        for key, c in raw.channels.items()
    }
    lines = tuple(f"{raw.path.name}: {line}" for line in raw.detected)
    return replace(raw, channels=channels, detected=lines)


def beside(path: Path, mapping: Mapping, table: JoinTable) -> tuple[Path, Mapping]:
    """A joined file, and the mapping with its series as that file names them.

    Args:
        path: the first file.
        mapping: of both.
        table: the join.

    Raises:
        InputError: there is no such file.
    """
    entries = [
        ChannelTable(series=s.partition(":")[2], to="force")
        for _, _, parts, _ in mapping.entries
        for s in parts
        if s.startswith(f"{table.name}:")
    ]
    file = regular_file(path.parent / table.file.replace("{stem}", path.stem))
    return file, Mapping.model_construct(source=table.source, time=table.time, channel=entries)


def read_mapped(
    path: str | Path, mapping: Mapping, *, file: str | None = None, mapping_file: Path | None = None
) -> Campaign:
    """Read a foreign file as a campaign of one record, in memory; of several where it has gaps.

    Args:
        path: the file.
        mapping: what its series become.
        file: the record's name; the file's own with .csv where None.
        mapping_file: for messages.

    Returns:
        the campaign.

    Raises:
        InputError: the file can't be read, or the mapping does not fit it.
    """
    return _read_mapped(path, mapping, file, mapping_file)[0]


def _read_mapped(
    path: str | Path, mapping: Mapping, file: str | None, mapping_file: Path | None
) -> tuple[Campaign, tuple[str, ...]]:
    """The campaign, and what was detected."""
    if not mapping.entries:
        raise InputError("needs a [[channel]] or a [[coupling]]", file=mapping_file)
    if (kind := mapping.record.get("kind")) in ("static", "frf"):
        raise InputError(f"a table of the kind {kind} needs no import, as it has no clock",
                         file=mapping_file, key="record.kind", hint=f"list it in campaign.toml: "
                         f"[[record]] file = {Path(path).name!r}, kind = {kind!r}; its columns are "
                         "named `channel [unit]`")  # fmt: skip
    raw = joined(read_raw(path, mapping), mapping, mapping_file)
    used: dict[str, RawChannel] = {}
    for key, _, parts, _ in mapping.entries:
        for series in parts:
            used[series] = raw.channel(series, mapping=mapping_file, key=key)
    pieces = common_clock(raw, mapping.time, list(used.values()), mapping_file, mapping.filter)
    table = dict(mapping.record)
    if raw.taken is not None:
        table.setdefault("time", raw.taken)
    name = file or f"{Path(path).stem}.csv"
    stem, _, ending = name.rpartition(".")
    records = []
    try:
        for count, (time, values) in enumerate(pieces, start=1):
            own = name if count == 1 else f"{stem}-{count}.{ending}"
            stored = dict(zip(used, values, strict=True))
            channels, units = _channels(mapping, raw, stored, time, mapping_file)
            records.append(Record.from_arrays(own, time, channels, units=units, **table))
        campaign = Campaign.from_records(records, **mapping.campaign)
    except InputError as error:
        raise error if error.file else error.placed(file=mapping_file or path) from None
    for record in records:
        record.check_samples()
    lines = raw.told
    if len(records) > 1:
        lines = (*lines, f"split at its gaps into {len(records)} records")
    return campaign, lines


def _channels(
    mapping: Mapping,
    raw: RawFile,
    values: dict[str, FloatArray],
    time: FloatArray,
    file: Path | None,
) -> tuple[dict[str, FloatArray], dict[str, str]]:
    """The channels that series become, SI, and their units."""
    channels: dict[str, FloatArray] = {}
    units: dict[str, str] = {}
    for _, to, parts, entry in mapping.entries:
        if to in channels:
            raise InputError("two series become this channel", file=file, key=to)
        stored = combined(values, parts)
        first = raw.channels[next(iter(parts))]
        channels[to], units[to] = _converted(entry, first, stored, time, file)
    return channels, units


def combined(values: dict[str, FloatArray], parts: dict[str, float]) -> FloatArray:
    """Series added up; one of factor 1 as it is.

    Args:
        values: by series.
        parts: {series: factor}.

    Returns:
        (m,) their sum.
    """
    if len(parts) == 1 and next(iter(parts.values())) == 1.0:
        return values[next(iter(parts))]
    total: FloatArray = sum(factor * values[series] for series, factor in parts.items())  # type: ignore[assignment]
    return total


def _converted(
    entry: ChannelTable, raw: RawChannel, values: FloatArray, time: FloatArray, file: Path | None
) -> tuple[FloatArray, str]:
    """The mapped values in SI, sign * (scale * stored + offset), and their SI unit."""
    try:
        channel, convert = parse_channel(entry.to, entry.unit or raw.unit)
    except InputError as error:
        raise error.placed(file=file, key=f"{entry.series} -> {entry.to}") from None
    if problem := implausible(replace(raw, values=convert(values)), entry.to):
        warn_user(f"{file or 'mapping'}: {problem}")
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


@dataclass(frozen=True, eq=False, repr=False)
class ImportedRecord(Result):
    """A record that was imported, and the campaign that it is part of.

    Attributes:
        campaign: as it stands on disk; in memory where nothing was to be written.
        origin: provenance of this record.
        detected: what was found out about the file, a sentence each.
        records_added: how many records the file became: its gaps divide it.
    """

    PLOTS: ClassVar = {"record": "visuals.plots.results:plot_first_record"}
    LACKS: ClassVar = {"show": "a record alone has no robot"}

    campaign: Campaign
    origin: dict[str, Any]
    detected: tuple[str, ...] = ()
    records_added: int = 1

    @property
    def record(self) -> Record:
        """The record that was imported; of several, the first."""
        return self.campaign.records[-self.records_added]

    def to_frame(self) -> pandas.DataFrame:
        """The record, a row a sample."""
        return self.record.to_frame()

    def _headline(self) -> str:
        clock = self.record.clock
        return f"{self.record.file}, {clock.samples} samples at {clock.rate:.6g} Hz"

    def _repr_html_(self) -> str:
        return self.campaign._repr_html_()

    def _content(self) -> dict[str, Any]:
        return {
            "format": "picchio-import/1",
            "campaign": self.campaign.folder,
            "record": self.record.file,
            "channels": list(self.record.channels),
            "samples": self.record.clock.samples,
            "sample_rate": self.record.clock.rate,
            "records": [r.file for r in self.campaign.records[-self.records_added :]],
            "detected": list(self.detected),
            "provenance": self.origin,
        }


def import_record(
    file: str | Path,
    to: str | Path | None = None,
    mapping: str | Path | None = None,
    *,
    name: str | None = None,
    append: bool = False,
) -> ImportedRecord:
    """Import a file of another format as a record of a campaign; of several where it has gaps.

    CSV of any habit, Parquet, MCAP, ROS 2 .db3, ROS 1 .bag, UFF 58, MATLAB, .lvm, .npz, JSON lines.

    Args:
        file: the file.
        to: the campaign's folder; the mapping is kept there as mapping.toml. None: the campaign
            stays in memory.
        mapping: what the file's series become (`picchio-mapping/1`).
        name: the record's name (.csv or .parquet); the file's own with .csv if None.
        append: add the record to the campaign that stands at `to`.

    Returns:
        the new record, and the campaign that it is in.

    Raises:
        InputError: the file or the mapping cannot be read, they do not fit each other, or the
            campaign at `to` says otherwise than the mapping.
        OutputError: the campaign cannot be written, or another process has been at it for a minute.
    """
    source = Path(file)
    files = parts_of(source)
    if mapping is None:
        raise InputError(
            "needs a mapping from its series to the campaign's channels",
            file=source,
            key="--mapping",
            hint=_own_record(source)
            or f"`picchio import {source} --write-mapping mapping.toml` writes one to edit",
        )
    rules = Path(mapping)
    new, found = _read_mapped(source, read_mapping(rules), name, rules)
    added = len(new.records)
    origin = provenance([*files, rules])
    if to is None:
        return ImportedRecord(_noted(new, origin), origin, found, added)
    extra = {"mapping.toml": rules.read_bytes()}
    # Two that append at once would each add to the campaign as it was before.
    with locked(Path(to), patience=_PATIENCE) if Path(to).parent.is_dir() else nullcontext():
        if append:
            new, extra = _appended(new, Path(to), extra["mapping.toml"])
        made = _noted(new, origin).save(to, overwrite=append, extra_files=extra)
    return ImportedRecord(made, origin, found, added)


def _own_record(path: Path) -> str:
    """What to do with a file that is a record of the campaign in its folder; "" of others."""
    try:
        table = read_toml(path.parent / CAMPAIGN_FILE)
    except InputError:
        return ""
    files = [entry.get("file") for entry in table.get("record", ()) if isinstance(entry, dict)]
    if path.name not in files:
        return ""
    return (f"it is a record of the campaign {path.parent} already and needs no import: "
            f"`picchio check ROBOT --data {path.parent}`")  # fmt: skip


def _appended(new: Campaign, to: Path, mapping: bytes) -> tuple[Campaign, dict[str, bytes]]:
    """The campaign at `to` with the new record in it, and the mapping's file."""
    old = load_campaign(to)
    settings = new.table.model_dump(exclude_none=True, exclude_defaults=True, exclude={"record"})
    standing = old.table.model_dump(exclude_none=True, exclude_defaults=True, exclude={"record"})
    for key, value in settings.items():
        same = standing.get(key) == value
        if key == "robot" and not same:  # saving wrote the way to the same file anew
            files = [Path(robot) for robot in (new.robot, old.robot) if robot is not None]
            same = (
                len(files) == 2 and all(f.is_file() for f in files) and files[0].samefile(files[1])
            )
        if not same:
            raise InputError("the mapping says otherwise than the campaign that stands there",
                             file=to, key=key, value=value,
                             hint="what is this record's own belongs under [record]")  # fmt: skip
    if old.robot is not None:
        standing["robot"] = old.robot
    try:
        campaign = Campaign.from_records([*old.records, *new.records], **standing)
    except InputError as error:
        raise error.placed(file=to) from None
    first = to / "mapping.toml"
    if first.is_file() and first.read_bytes() != mapping:
        return campaign, {f"{Path(new.records[0].file).stem}.mapping.toml": mapping}
    return campaign, {"mapping.toml": mapping}


def _noted(campaign: Campaign, made: dict[str, Any]) -> Campaign:
    """The campaign with the import noted in its [provenance]."""
    before = (campaign.table.provenance or {}).get("inputs", [])
    found = {
        "picchio": made["picchio"],
        "inputs": [entry for entry in before if entry not in made["inputs"]] + made["inputs"],
    }
    return replace(campaign, table=campaign.table.model_copy(update={"provenance": found}))
