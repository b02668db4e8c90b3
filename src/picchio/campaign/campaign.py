"""A campaign: the records of one robot, and what was known about them beforehand."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from picchio.campaign.clock import TOLERANCE
from picchio.campaign.csv_source import CsvSource
from picchio.campaign.parquet_source import ParquetSource
from picchio.campaign.record import Record
from picchio.campaign.source import Source
from picchio.campaign.tables import (
    CAMPAIGN_FILE,
    FORMAT,
    CampaignExcitation,
    CampaignTable,
    RecordTable,
    Tolerance,
)
from picchio.core.errors import InputError, PicchioWarning
from picchio.core.toml import parse_toml, validate


@dataclass(frozen=True, eq=False)
class Campaign:
    """Records of one robot.

    Attributes:
        table: `campaign.toml` as written.
        records: in its order.
        folder: None for a campaign in memory.
    """

    table: CampaignTable
    records: tuple[Record, ...]
    folder: Path | None = None

    @classmethod
    def from_records(cls, records: Iterable[Record], **table: Any) -> Campaign:
        """A campaign in memory.

        Args:
            records: as `Record.from_arrays` makes them, or those of another campaign.
            **table: the other keys of `campaign.toml`: robot, tool, excitation, ...

        Raises:
            InputError: an unknown key or a wrong value.
        """
        given = list(records)
        content = {"format": FORMAT, **{k: v for k, v in table.items() if v is not None}}
        content["record"] = [r.table.model_dump(exclude_none=True) for r in given]
        checked = validate(content, CampaignTable, format=FORMAT)
        bound = tuple(record.within(checked.excitation) for record in given)
        campaign = cls(checked, bound)
        campaign._check()
        return campaign

    @property
    def robot(self) -> str | None:
        """What `load_robot` takes: a name, or the path of a URDF found beside the campaign."""
        if self.table.robot is None or self.folder is None:
            return self.table.robot
        beside = self.folder / self.table.robot
        return os.path.normpath(beside) if beside.is_file() else self.table.robot

    @property
    def tool(self) -> str | None:
        """Frame where the tool's force acts."""
        return self.table.tool

    @property
    def excitation(self) -> CampaignExcitation:
        """The blows as programmed, where a record does not say otherwise."""
        return self.table.excitation

    @property
    def tolerance(self) -> Tolerance:
        """Relative standard deviations of the nominal values."""
        return self.table.tolerance

    @property
    def controller(self) -> Mapping[str, Any] | None:
        """A known control law."""
        return self.table.controller

    @property
    def files(self) -> tuple[Path, ...]:
        """Every file of the campaign, for provenance."""
        if self.folder is None:
            return ()
        sources = [r.source.path for r in self.records if r.source.path is not None]
        blows = {r.excitation.file for r in self.records if r.excitation.file}
        return (self.folder / CAMPAIGN_FILE, *sources, *(self.folder / b for b in sorted(blows)))

    def __len__(self) -> int:
        return len(self.records)

    def __iter__(self) -> Iterator[Record]:
        return iter(self.records)

    def __getitem__(self, file: str) -> Record:
        """The record of this file name.

        Raises:
            InputError: there is none.
        """
        for record in self.records:
            if record.file == file:
                return record
        raise InputError("no such record", file=self.folder, value=file,
                         choices=[record.file for record in self.records])  # fmt: skip

    def __repr__(self) -> str:
        return f"Campaign({len(self.records)} records, robot={self.table.robot!r})"

    def _repr_html_(self) -> str:
        from picchio.core.html import sheet

        facts = {"robot": self.table.robot, "tool frame": self.tool, "folder": self.folder and
                 self.folder.name}  # fmt: skip
        rows = [(r.file, r.kind, r.direction, ", ".join(r.channels)) for r in self.records]
        columns = ("record", "kind", "force along", "channels")
        return sheet(f"Campaign of {len(rows)} records", facts, columns, rows)

    def check_samples(self) -> None:
        """Read every sample once, in constant memory.

        Raises:
            InputError: at the first that is missing, not finite or out of time, with its line.
        """
        for record in self.records:
            record.check_samples()

    def save(self, folder: str | Path, *, suffix: str | None = None,
             overwrite: bool = False) -> Campaign:  # fmt: skip
        """Write the campaign to a folder; see `write_campaign`."""
        from picchio.campaign.write import write_campaign

        return write_campaign(self, folder, suffix=suffix, overwrite=overwrite)

    def _check(self) -> None:
        """What one table alone cannot know."""
        file = self.folder / CAMPAIGN_FILE if self.folder is not None else None
        seen: dict[str, int] = {}
        for index, record in enumerate(self.records):
            key = f"record[{index}]"
            if record.file.lower() in seen:
                raise InputError(f"the same file as record[{seen[record.file.lower()]}]",
                                 file=file, key=f"{key}.file", value=record.file)  # fmt: skip
            seen[record.file.lower()] = index
            _check_record(record, key, file)


def _check_record(record: Record, key: str, file: Path | None) -> None:
    if record.kind == "motion":
        if useless := record.table.percussion_keys():
            text = f"{file}: {key} ({record.file}): a motion record has no use for "
            warnings.warn(text + ", ".join(useless), PicchioWarning, stacklevel=4)
        return
    for name in ("pose", "direction"):
        if getattr(record.table, name) is None:
            raise InputError(f"a percussion record ({record.file}) needs this key",
                             file=file, key=f"{key}.{name}")  # fmt: skip
    if record.blows() is None and "force" not in record.channels:
        raise InputError(
            f"{record.file} has no measured force, and [excitation] does not state the blows",
            file=file, key=key,
        )  # fmt: skip


def load_campaign(path: str | Path, *, clock_tolerance: float = TOLERANCE) -> Campaign:
    """Open a campaign: its table and the headers of its files are read, the samples are not.

    Args:
        path: the folder, or its `campaign.toml`.
        clock_tolerance: how uneven a record's clock may be, in steps; infinite to take any
            clock that ascends (to look at a bad record).

    Raises:
        InputError: a wrong table, a missing file, a wrong header.
    """
    given = Path(path)
    if not given.exists():
        raise InputError("no such campaign", file=given)
    folder = given if given.is_dir() else given.parent
    file = given / CAMPAIGN_FILE if given.is_dir() else given
    if not file.is_file():
        raise InputError(f"is no campaign: it holds no {CAMPAIGN_FILE}", file=given)
    table = parse_toml(file, CampaignTable, format=FORMAT)
    records = tuple(
        Record(entry, _open(folder, entry, index), table.excitation, folder, clock_tolerance)
        for index, entry in enumerate(table.record)
    )
    campaign = Campaign(table, records, folder)
    campaign._check()
    return campaign


def _open(folder: Path, entry: RecordTable, index: int) -> Source:
    path, key = folder / entry.file, f"record[{index}]"
    if not os.path.realpath(path).startswith(os.path.realpath(folder) + os.sep):
        raise InputError("leads out of the campaign's folder", file=path, key=f"{key}.file")
    return ParquetSource(path, key) if path.suffix == ".parquet" else CsvSource(path, key)
