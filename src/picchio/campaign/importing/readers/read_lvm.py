"""LabVIEW measurement files (.lvm): text with a header, one or more segments.

Source: National Instruments, "Specification for the LabVIEW Measurement File (.lvm)".
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from picchio.campaign.importing.detect import moment
from picchio.campaign.importing.isolated import Limits
from picchio.campaign.importing.raw import Names, RawChannel, RawFile
from picchio.core.errors import InputError
from picchio.core.files import read_bytes

LIMITS = Limits(memory_a_byte=128.0)
_END = "***End_of_Header***"
_LARGEST = 1 << 30


def read(path: Path, clock: Mapping[str, Any]) -> RawFile:
    """Every channel, with the times of its X column, or X0 and Delta_X where there is none.

    Segments follow one another; each must have the channels of the first.

    Args:
        path: the file.
        clock: the mapping's `[time]`.

    Raises:
        InputError: no .lvm file, a row that is no row of numbers, segments that differ.
    """
    content = read_bytes(path, limit=_LARGEST)
    try:
        lines = content.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:  # what LabVIEW writes where a comment has umlauts
        lines = content.decode("cp1252", errors="replace").splitlines()
    if not lines or not lines[0].startswith("LabVIEW Measurement"):
        raise InputError("is no LabVIEW measurement file", file=path,
                         value=lines[0][:60] if lines else "")  # fmt: skip
    try:
        end = lines.index(next(x for x in lines if x.strip() == _END))
    except StopIteration:
        raise InputError(f"has no {_END}", file=path) from None
    separator = "," if any(x.lower().startswith("separator") and "comma" in x.lower()
                           for x in lines[:end]) else "\t"  # fmt: skip
    said = dict(line.split(separator, 1) for line in lines[:end] if separator in line)
    decimal = said.get("Decimal_Separator", ".").strip() or "."
    columns = said.get("X_Columns", "One").strip(" \t,")
    epoch = _date(said.get("Date", ""), said.get("Time", ""))
    at = end + 1
    names: list[str] = []
    units: dict[str, str] = {}
    values: dict[str, list[float]] = {}
    times: dict[str, list[float]] = {}
    while at < len(lines):
        head: dict[str, list[str]] = {}
        while at < len(lines) and lines[at].strip() != _END:
            if lines[at].strip():
                key, *cells = lines[at].split(separator)
                head[key] = cells
            at += 1
        if at >= len(lines):
            break
        if at + 1 >= len(lines):
            raise InputError("ends within a header", file=path, key=f"line {at + 1}")
        labels = [x.strip() for x in lines[at + 1].split(separator)]
        own = [x for x in labels if x not in ("X_Value", "Comment", "")]
        unique = Names()
        own = [unique(x) for x in own]
        if names and own != names:
            raise InputError("this segment has other channels than the first", file=path,
                             key=f"line {at + 2}", value=", ".join(own))  # fmt: skip
        names = own
        unit = [x.strip() for x in head.get("Y_Unit_Label", [])]
        units = dict(zip(names, unit, strict=False))
        try:
            offset, step = ([_number(x, decimal) for x in head.get(key, []) if x.strip()]
                            for key in ("X0", "Delta_X"))  # fmt: skip
        except ValueError as error:
            raise InputError("X0 or Delta_X is no number", file=path, key=f"line {at + 1}",
                             value=str(error).partition(": ")[2][:60]) from None  # fmt: skip
        if columns == "No" and min(len(offset), len(step)) < len(names):
            raise InputError("has neither an X column nor X0 and Delta_X of each channel",
                             file=path, key=f"line {at + 1}")  # fmt: skip
        at, row = at + 2, 0
        while at < len(lines) and lines[at].strip():
            cells = lines[at].split(separator)[: _width(columns, len(names))]
            try:
                numbers = [_number(x, decimal) for x in cells]
            except ValueError:
                raise InputError("is no row of numbers", file=path, key=f"line {at + 1}",
                                 value=lines[at][:60]) from None  # fmt: skip
            if len(numbers) < _width(columns, len(names)):
                raise InputError(f"must have {len(names)} channels", file=path,
                                 key=f"line {at + 1}", value=lines[at][:60])  # fmt: skip
            if columns == "Multi":
                pairs = list(zip(numbers[::2], numbers[1::2], strict=True))
            elif columns == "No":
                pairs = [(offset[i] + row * step[i], v) for i, v in enumerate(numbers[1:])]
            else:
                pairs = [(numbers[0], v) for v in numbers[1:]]
            for name, (time, value) in zip(names, pairs, strict=False):
                times.setdefault(name, []).append(time)
                values.setdefault(name, []).append(value)
            at, row = at + 1, row + 1
        at += 1
    if not values:
        raise InputError("holds no series of numbers", file=path)
    channels = {
        name: RawChannel(name, np.array(values[name]), np.array(times[name]),
                         units.get(name) or None)
        for name in names
    }  # fmt: skip
    return RawFile(path, "lvm", channels, None, epoch)


def _width(columns: str, channels: int) -> int:
    """Cells of numbers in a row: without an X column its cell is there and empty."""
    return 2 * channels if columns == "Multi" else channels + 1


def _number(cell: str, decimal: str) -> float:
    """Of a cell; an empty one is missing."""
    return float(cell.strip().replace(decimal, ".") or "nan")


def _date(date: str, time: str) -> int | None:
    """Ns from 1970, of the two lines of the header; local time is taken for UTC."""
    text = f"{date.strip()} {time.strip().replace(',', '.')}".replace("/", "-")
    return moment(text)
