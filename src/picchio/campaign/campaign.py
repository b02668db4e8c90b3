"""A campaign: the measured records of one robot, read from a folder and written to one."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, ClassVar

from picchio.campaign.channels import parse_channel
from picchio.campaign.clock import TOLERANCE
from picchio.campaign.csv_source import TextSource, write_csv
from picchio.campaign.parquet_source import ParquetSource, write_parquet
from picchio.campaign.record import LAYOUTS, Record
from picchio.campaign.source import Source
from picchio.campaign.tables import (
    CAMPAIGN_FILE,
    FORMAT,
    SUFFIXES,
    UFF_SUFFIXES,
    CampaignExcitation,
    CampaignTable,
    RecordTable,
    Tolerance,
)
from picchio.campaign.uff import ORDINATE, frf_source
from picchio.core.errors import InputError, warn_user
from picchio.core.files import part_of, recover, relative_name, swap_in, writing
from picchio.core.guard import guard
from picchio.core.shown import Shown
from picchio.core.toml import parse_toml, validate
from picchio.core.unfinished import unfinished

if TYPE_CHECKING:
    import pandas

MAPPING_FILE = "mapping.toml"


@dataclass(frozen=True, eq=False)
class Campaign(Shown):
    """Records of one robot.

    Attributes:
        table: `campaign.toml` as written.
        records: in its order.
        folder: None for a campaign in memory.
    """

    PLOTS: ClassVar = {"record": "visuals.plots.results:plot_first_record"}
    LACKS: ClassVar = {"show": "records alone have no robot"}

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
        bound = tuple(replace(r, base_excitation=checked.excitation) for r in given)
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
        """Standard deviations of the nominal values."""
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

    def to_frame(self) -> pandas.DataFrame:
        """A row a record: its kind, direction and channels."""
        import pandas

        rows = [(r.file, r.kind, r.direction, ", ".join(r.channels)) for r in self.records]
        columns = ["record", "kind", "direction", "channels"]
        return pandas.DataFrame(rows, columns=columns).set_index("record")

    def _repr_html_(self) -> str:
        from picchio.core.html import sheet

        facts = {"robot": self.table.robot, "tool frame": self.tool, "folder": self.folder and
                 self.folder.name}  # fmt: skip
        rows = [(r.file, r.kind, r.direction, ", ".join(r.channels)) for r in self.records]
        columns = ("record", "kind", "force along", "channels")
        return sheet(f"Campaign of {len(rows)} records", facts, columns, rows)

    def of_work(self, of: str) -> Campaign:
        """The records of blows and motions; a warning tells tests that are left out.

        Args:
            of: who has no use for the others, in words.

        Raises:
            InputError: none is left.
        """
        kept = tuple(record for record in self.records if record.kind in ("percussion", "motion"))
        if len(kept) == len(self.records):
            return self
        others = sorted({record.kind for record in self.records if record not in kept})
        text = f"{of} has no use for {' and '.join(others)} records"
        if not kept:
            file = self.folder / CAMPAIGN_FILE if self.folder is not None else None
            raise InputError(f"{text}, and there are no others", file=file, key="record",
                             hint="`picchio identify` reads them")  # fmt: skip
        warn_user(f"{text}: {len(self.records) - len(kept)} are left out")
        table = self.table.model_copy(update={"record": [record.table for record in kept]})
        return replace(self, table=table, records=kept)

    def check_samples(self) -> None:
        """Read every sample once, in constant memory.

        Raises:
            InputError: at the first that is missing, not finite or out of time, with its line.
        """
        for record in self.records:
            record.check_samples()

    def save(
        self,
        folder: str | Path,
        *,
        suffix: str | None = None,
        overwrite: bool = False,
        extra_files: Mapping[str, bytes] | None = None,
    ) -> Campaign:
        """Write the campaign, in memory or from elsewhere, to a folder.

        The whole folder appears, or nothing changes: everything goes to a folder beside the target,
        which is then renamed. Samples are checked on the way and written in SI, block by block;
        floats read back bit for bit.

        Args:
            folder: where to; its parent must exist.
            suffix: ".csv" or ".parquet" for every record; None keeps each record's own.
            overwrite: replace a campaign that stands there, but for what else lies in its folder;
                any other folder is never replaced.
            extra_files: further files by name, such as {"mapping.toml": b"..."}.

        Returns:
            the campaign as it was written, read from the folder.

        Raises:
            InputError: the folder exists, or a sample is wrong.
            OutputError: the disk is full or read-only, or the permission is missing.
        """
        target = Path(folder)
        _check_target(target, overwrite)
        if suffix is not None and suffix not in SUFFIXES:
            raise InputError("unknown kind of file", value=suffix, choices=SUFFIXES)
        with writing(target), unfinished(partial(part_of, target, folder=True)) as temporary:
            _fill(self, temporary, target, suffix, extra_files or {})
            load_campaign(temporary)
            _keep_others(target, temporary)
            swap_in(temporary, target)
        return load_campaign(target)

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


_WORDS = {"frf": "frequency response function"}
_NEEDED = {
    "percussion": ("pose", "direction"),
    "clamped": ("pose",),
    "frf": ("pose", "force_direction", "response_direction"),
}


def _check_record(record: Record, key: str, file: Path | None) -> None:
    kind, table, name = record.kind, record.table, record.file
    joint_map = ["joint_map"] if table.joint_map is not None else []
    for only, found in (("static", joint_map), ("frf", table.frf_keys())):
        if kind != only and found:
            words = _WORDS.get(only, f"{only} record")
            raise InputError(f"only a {words} may have it; {name} is one of {kind}", file=file,
                             key=f"{key}.{found[0]}")  # fmt: skip
    if kind != "frf" and Path(name).suffix in UFF_SUFFIXES:
        raise InputError("only frequency response functions are read from UFF files as they are",
                         file=file, key=f"{key}.file", value=name,
                         hint="`picchio import` makes a campaign of time histories")  # fmt: skip
    for needed in _NEEDED.get(kind, ()):
        if getattr(table, needed) is None:
            words = _WORDS.get(kind, f"{kind} record")
            raise InputError(f"a {words} ({name}) needs this key", file=file,
                             key=f"{key}.{needed}")  # fmt: skip
    if kind == "frf":
        if missing := [part for part in ("real", "imag") if part not in record.channels]:
            raise record.source.error("has no such column", channel=missing[0])
        wanted = f"{ORDINATE[table.quantity or 'accelerance'][1]}/N"
        units = [record.channel(part).unit for part in ("real", "imag")]
        if units[0] != units[1] or units[0] not in ("1", wanted):
            raise record.source.error("both parts must be in the unit of the record's quantity",
                                      channel="real, imag", value=" and ".join(units),
                                      choices=[f"a multiple of {wanted}"])  # fmt: skip
    pressed = any(record.channel(one).kind.name == "torque" for one in record.channels)
    if kind == "clamped" and not pressed:
        raise record.source.error("has no column torque.<joint>, of no motor that presses")
    if kind != "percussion" and (useless := table.percussion_keys()):
        text = f"{file}: {key} ({name}): a {kind} record has no use for "
        warn_user(text + ", ".join(useless))
    if kind == "percussion" and record.blows() is None and "force" not in record.channels:
        raise InputError(f"{name} has no measured force, and [excitation] does not state the blows",
                         file=file, key=key)  # fmt: skip


def load_campaign(path: str | Path | Campaign, *, clock_tolerance: float = TOLERANCE) -> Campaign:
    """Open a campaign: its table and the headers of its files are read, the samples are not.

    Args:
        path: the folder, or its `campaign.toml`. A campaign that is loaded already is taken as
            it is.
        clock_tolerance: how uneven a record's clock may be, in steps; infinite to take any
            clock that ascends (to look at a bad record).

    Returns:
        the campaign; samples are read when they are asked for.

    Raises:
        InputError: a wrong table, a missing file, a wrong header.
    """
    if isinstance(path, Campaign):
        return path
    given = Path(path)
    if not given.exists():
        if not recover(given):
            raise InputError("no such campaign", file=given)
        warn_user(
            f"{given}: its replacement was interrupted; the campaign from before it is "
            "in its place again"
        )
    folder = given if given.is_dir() else given.parent
    file = given / CAMPAIGN_FILE if given.is_dir() else given
    if not file.is_file():
        raise InputError(f"is not a campaign: it has no {CAMPAIGN_FILE}", file=given)
    table = parse_toml(file, CampaignTable, format=FORMAT)
    records = tuple(
        Record(entry, _open(folder, entry, index), table.excitation, folder, clock_tolerance)
        for index, entry in enumerate(table.record)
    )
    campaign = Campaign(table, records, folder)
    campaign._check()
    guard.reading(campaign.files)
    return campaign


def _open(folder: Path, entry: RecordTable, index: int) -> Source:
    path, key = folder / entry.file, f"record[{index}]"
    if not os.path.realpath(path).startswith(os.path.realpath(folder) + os.sep):
        raise InputError("is outside the campaign's folder", file=path, key=f"{key}.file")
    if path.suffix in UFF_SUFFIXES and entry.kind == "frf":
        return frf_source(path, key, LAYOUTS["frf"], entry)
    kind = ParquetSource if path.suffix == ".parquet" else TextSource
    return kind(path, key, LAYOUTS.get(entry.kind))


def _check_target(target: Path, overwrite: bool) -> None:
    if not target.name or target.is_symlink() or (target.exists() and not target.is_dir()):
        raise InputError("a campaign is a folder, this is a file", file=target)
    if not target.parent.is_dir():
        raise InputError("no such folder to write in", file=target.parent)
    if not target.exists() or not any(target.iterdir()):
        return
    if not (target / CAMPAIGN_FILE).is_file():
        raise InputError("the folder exists and is not a campaign; it is not replaced", file=target)
    if not overwrite:
        raise InputError("a campaign exists here already", file=target,
                         hint="choose another folder, or say to overwrite it")  # fmt: skip


def _fill(campaign: Campaign, folder: Path, target: Path, suffix: str | None,
          extra_files: Mapping[str, bytes]) -> None:  # fmt: skip
    for name, content in {**_other_files(campaign), **extra_files}.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    names: list[str] = []
    for record in campaign.records:
        own = ".csv" if PurePosixPath(record.file).suffix in UFF_SUFFIXES else None
        wanted = suffix or own  # a UFF file is not written
        name = str(PurePosixPath(record.file).with_suffix(wanted)) if wanted else record.file
        if name.lower() in map(str.lower, names):
            raise InputError("two records would have this name", file=target, value=name)
        names.append(name)
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        channels = list(record.source.channels.values())
        layout = record.source.layout
        if layout.first is not None:
            channels.insert(0, parse_channel(layout.first, None, layout.kinds)[0])
        write = write_parquet if path.suffix == ".parquet" else write_csv
        write(path, channels, record.chunks())
    (folder / CAMPAIGN_FILE).write_text(_toml(campaign, names, target), encoding="utf-8")


def _keep_others(target: Path, folder: Path) -> None:
    """What else lies in the folder of a campaign that is replaced stays there."""
    if not (target / CAMPAIGN_FILE).is_file():
        return
    own = {CAMPAIGN_FILE, *(entry.file for entry in load_campaign(target).table.record)}
    for path in target.rglob("*"):
        name = path.relative_to(target)
        if name.as_posix() in own or path.is_dir() or (folder / name).exists():
            continue
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(path, folder / name, follow_symlinks=False)


def _other_files(campaign: Campaign) -> dict[str, bytes]:
    """What the campaign names beside its records: blow files and the import's mapping."""
    found: dict[str, bytes] = {}
    for record in campaign.records:
        if record.excitation.file and record.folder is not None:
            found[record.excitation.file] = (record.folder / record.excitation.file).read_bytes()
    for folder in {record.folder for record in campaign.records if record.folder is not None}:
        for path in folder.glob(f"*{MAPPING_FILE}"):
            found[path.name] = path.read_bytes()
    return found


def _inline(value: Any) -> Any:
    """Tables on one line, those within them, too."""
    import tomlkit

    if not isinstance(value, dict):
        return value
    table = tomlkit.inline_table()
    for key, part in value.items():
        table[key] = _inline(part)
    return table


def _toml(campaign: Campaign, names: list[str], target: Path) -> str:
    import tomlkit

    document = tomlkit.document()
    document["format"] = FORMAT
    content = campaign.table.model_dump(exclude_none=True, exclude_defaults=True)
    content["record"] = [
        {**record.table.model_dump(exclude_none=True), "kind": record.kind, "file": name}
        for record, name in zip(campaign.records, names, strict=True)
    ]
    if campaign.table.robot is not None:
        # A URDF is named relative to the campaign's file, wherever that moves.
        robot = str(campaign.robot)
        content["robot"] = relative_name(robot, target) if Path(robot).is_file() else robot
    for key in ("robot", "tool", "notes", "excitation", "tolerance", "controller", "provenance"):
        if content.get(key) is not None:
            document[key] = content[key]
    entries = tomlkit.aot()
    for entry in content["record"]:
        table = tomlkit.table()
        for key in sorted(entry, key=lambda name: name != "file"):
            table[key] = _inline(entry[key])
        entries.append(table)
    document["record"] = entries
    return tomlkit.dumps(document)
