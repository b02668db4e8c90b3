"""A foreign file and its mapping become a record."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from picchio.campaign.campaign import Campaign, load_campaign
from picchio.campaign.channels import TIME, parse_channel
from picchio.campaign.importing import read_csv
from picchio.campaign.importing.isolated import read_isolated
from picchio.campaign.importing.mapping import ChannelTable, Mapping, read_mapping
from picchio.campaign.importing.raw import RawChannel, RawFile
from picchio.campaign.importing.resample import common_clock
from picchio.campaign.record import Record
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.core.files import locked, regular_file
from picchio.core.provenance import provenance
from picchio.core.results import Result

_ISOLATED = {kind: f"picchio.campaign.importing.read_{kind}" for kind in ("uff", "mcap", "matlab")}
_ENDINGS = {".csv": "csv", ".txt": "csv", ".tsv": "csv", ".uff": "uff", ".unv": "uff",
            ".mcap": "mcap", ".mat": "matlab"}  # fmt: skip

# s that an import waits for another one into the same campaign.
_PATIENCE = 60.0


def read_raw(path: str | Path, mapping: Mapping | None = None) -> RawFile:
    """The series of a foreign file.

    Raises:
        InputError: missing, of an unknown kind, or not readable.
    """
    source = regular_file(path)
    kind = (mapping.source.kind if mapping else None) or _ENDINGS.get(source.suffix.lower())
    if kind is None:
        raise InputError("the kind of file is not known by its ending", file=source,
                         value=source.suffix, choices=_ENDINGS,
                         hint="or say [source] kind in the mapping")  # fmt: skip
    if kind not in _ISOLATED:
        return read_csv.read(source, mapping)
    clock = mapping.time.model_dump() if mapping else {}
    return read_isolated(_ISOLATED[kind], source, clock)


def read_mapped(
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
    series = [
        raw.channel(entry.series, mapping=mapping_file, key=f"channel[{i}].from")
        for i, entry in enumerate(mapping.channel)
    ]
    time, values = common_clock(raw, mapping.time, series, mapping_file)
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
        campaign = Campaign.from_records([record], **mapping.campaign)
    except InputError as error:
        if error.file is not None:
            raise
        raise InputError(str(error), file=mapping_file or path) from None
    record.check_samples()
    return campaign


def _converted(
    entry: ChannelTable, raw: RawChannel, values: FloatArray, time: FloatArray, file: Path | None
) -> tuple[FloatArray, str]:
    """The mapped values in SI, sign * (scale * stored + offset), and their SI unit."""
    try:
        channel, convert = parse_channel(entry.to, entry.unit or raw.unit)
    except InputError as error:
        raise error.placed(file=file, key=f"{entry.series} -> {entry.to}") from None
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
    """

    campaign: Campaign
    origin: dict[str, Any]

    @property
    def record(self) -> Record:
        """The record that was imported."""
        return self.campaign.records[-1]

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
    """Import a file of another format (UFF 58, MCAP, MATLAB, CSV) as a record of a campaign.

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
    source = regular_file(file)
    if mapping is None:
        raise InputError(
            "needs a mapping from its series to the campaign's channels",
            file=source,
            key="--mapping",
            hint=f"`picchio import {source} --write-mapping mapping.toml` writes one to edit",
        )
    rules = Path(mapping)
    new = read_mapped(source, read_mapping(rules), file=name, mapping_file=rules)
    origin = provenance([source, rules])
    if to is None:
        return ImportedRecord(_noted(new, origin), origin)
    extra = {"mapping.toml": rules.read_bytes()}
    # Two that append at once would each add to the campaign as it was before.
    with locked(Path(to), patience=_PATIENCE) if Path(to).parent.is_dir() else nullcontext():
        if append:
            new, extra = _appended(new, Path(to), extra["mapping.toml"])
        made = _noted(new, origin).save(to, overwrite=append, extra_files=extra)
    return ImportedRecord(made, origin)


def _appended(new: Campaign, to: Path, mapping: bytes) -> tuple[Campaign, dict[str, bytes]]:
    """The campaign at `to` with the new record in it, and the mapping's file."""
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
