"""A campaign written to disk: the whole folder appears, or nothing changes."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import Any

from picchio.campaign.campaign import Campaign, load_campaign
from picchio.campaign.channels import TIME, parse_channel
from picchio.campaign.csv_source import write_csv
from picchio.campaign.parquet_source import write_parquet
from picchio.campaign.record import Record
from picchio.campaign.source import Block
from picchio.campaign.tables import CAMPAIGN_FILE, FORMAT, SUFFIXES
from picchio.core.errors import InputError

MAPPING_FILE = "mapping.toml"


def write_campaign(
    campaign: Campaign,
    folder: str | Path,
    *,
    suffix: str | None = None,
    overwrite: bool = False,
    extra_files: Mapping[str, bytes] | None = None,
) -> Campaign:
    """Write a campaign, in memory or from elsewhere, to a folder.

    Samples are checked on the way and written in SI; floats read back bit for bit. Everything
    goes to a folder beside the target, which is then renamed.

    Args:
        campaign: what to write; one larger than memory is copied block by block.
        folder: where; its parent must exist.
        suffix: ".csv" or ".parquet" for all records; as their names say where None.
        overwrite: replace a campaign that stands there. A folder that is none is never replaced.
        extra_files: further files by name, such as {"mapping.toml": b"..."}.

    Returns:
        the campaign as it now stands on disk.

    Raises:
        InputError: the folder exists or can't be written, or a sample is wrong.
    """
    target = Path(folder)
    _check_target(target, overwrite)
    if suffix is not None and suffix not in SUFFIXES:
        raise InputError("the kind of file is not known", value=suffix, choices=SUFFIXES)
    try:
        temporary = Path(
            tempfile.mkdtemp(prefix=f".{target.name}.", suffix=".part", dir=target.parent)
        )
    except OSError as error:
        raise InputError(f"cannot write here: {error.strerror}", file=target) from None
    try:
        os.chmod(temporary, 0o777 & ~_umask())
        _fill(campaign, temporary, target, suffix, extra_files or {})
        load_campaign(temporary)
        _put_in_place(temporary, target)
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", file=target) from None
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    return load_campaign(target)


def _check_target(target: Path, overwrite: bool) -> None:
    if not target.name or target.is_symlink() or (target.exists() and not target.is_dir()):
        raise InputError("a campaign is a folder; this is none", file=target)
    if not target.parent.is_dir():
        raise InputError("no such folder to write in", file=target.parent)
    if not target.exists() or not any(target.iterdir()):
        return
    if not (target / CAMPAIGN_FILE).is_file():
        raise InputError("the folder exists and is no campaign; it is left alone", file=target)
    if not overwrite:
        raise InputError("a campaign stands here already", file=target,
                         hint="choose another folder, or say to overwrite it")  # fmt: skip


def _put_in_place(temporary: Path, target: Path) -> None:
    if not target.exists() or not any(target.iterdir()):
        os.replace(temporary, target)
        return
    aside = Path(tempfile.mkdtemp(prefix=f".{target.name}.", suffix=".old", dir=target.parent))
    old = aside / target.name
    try:
        os.replace(target, old)
        try:
            os.replace(temporary, target)
        except BaseException:
            os.replace(old, target)
            raise
    finally:
        shutil.rmtree(aside, ignore_errors=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _fill(campaign: Campaign, folder: Path, target: Path, suffix: str | None,
          extra_files: Mapping[str, bytes]) -> None:  # fmt: skip
    for name, content in {**_other_files(campaign), **extra_files}.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    names: list[str] = []
    for record in campaign.records:
        name = str(PurePosixPath(record.file).with_suffix(suffix)) if suffix else record.file
        if name.lower() in map(str.lower, names):
            raise InputError("two records would have this name", file=target, value=name)
        names.append(name)
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        time, _ = parse_channel(TIME)
        channels = [time, *record.source.channels.values()]
        write = write_parquet if path.suffix == ".parquet" else write_csv
        write(path, channels, _numbered(record))
    (folder / CAMPAIGN_FILE).write_text(_toml(campaign, names, target), encoding="utf-8")


def _numbered(record: Record) -> Iterator[Block]:
    return ((0, block) for block in record.chunks())


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


def _toml(campaign: Campaign, names: list[str], target: Path) -> str:
    import tomlkit

    document = tomlkit.document()
    document["format"] = FORMAT
    content = campaign.table.model_dump(exclude_none=True, exclude_defaults=True)
    content["record"] = [
        {**_set_keys(record), "file": name}
        for record, name in zip(campaign.records, names, strict=True)
    ]
    if campaign.table.robot is not None:
        content["robot"] = _robot_from(campaign, target)
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


def _set_keys(record: Record) -> dict[str, Any]:
    return {**record.table.model_dump(exclude_none=True), "kind": record.kind}


def _inline(value: Any) -> Any:
    import tomlkit

    if not isinstance(value, dict):
        return value
    table = tomlkit.inline_table()
    table.update(value)
    return table


def _robot_from(campaign: Campaign, target: Path) -> str:
    """A URDF is named relative to the campaign's file, wherever that moves."""
    robot = str(campaign.robot)
    path = Path(robot)
    if not path.is_file():
        return robot
    return Path(os.path.relpath(path.resolve(), target.resolve())).as_posix()
