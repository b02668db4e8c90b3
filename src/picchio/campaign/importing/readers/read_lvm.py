"""LabVIEW measurement files (.lvm): text with a header, one or more segments.

Source: National Instruments, "Specification for the LabVIEW Measurement File (.lvm)".
"""

from __future__ import annotations

import io
import itertools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from picchio.campaign.importing.isolated import Limits
from picchio.campaign.importing.raw import RawChannel, RawFile
from picchio.core.arrays import FloatArray
from picchio.core.dates import moment
from picchio.core.errors import InputError
from picchio.core.files import regular_file
from picchio.core.tables import (
    Left,
    Names,
    Table,
    TextLayout,
    encoding_of,
    gathered,
    joined,
    read_table,
    stream_blocks,
)

LIMITS = Limits(memory_a_byte=128.0)
_END = "***End_of_Header***"
_LARGEST = 1 << 30


def read(path: Path, clock: Mapping[str, Any]) -> RawFile:
    """Every channel, with the times of its X column, or X0 and Delta_X where there is none.

    Segments follow one another; each must have the channels of the first. A file without LabVIEW's
    header is read as any table.

    Args:
        path: the file.
        clock: the mapping's `[time]`.

    Raises:
        InputError: no table, or segments that differ.
    """
    encoding = encoding_of(regular_file(path, limit=_LARGEST))
    lines = path.read_text(encoding, errors="replace").splitlines()
    if not lines or not lines[0].startswith("LabVIEW Measurement"):
        return RawFile.of_table(read_table(path))
    ends = [k for k, line in enumerate(lines) if line.strip(" \t,;") == _END]
    if not ends:
        raise InputError(f"has no {_END}", file=path)
    first = lines[: ends[0]]
    separator = next((s for s in "\t,;" if any(x.startswith(f"Separator{s}") for x in first)), "\t")
    said = _said(first, separator)
    decimal = (said.get("Decimal_Separator") or ["."])[0]
    columns = (said.get("X_Columns") or ["One"])[0]
    layout = TextLayout(delimiter=separator, decimal="," if decimal == "," else ".")
    parts: dict[str, list[tuple[FloatArray, FloatArray]]] = {}
    units: dict[str, str] = {}
    left: list[Left] = []
    told: tuple[str, ...] = ()
    begin = ends[0]
    for end in ends[1:]:
        head = _said(lines[begin + 1 : end], separator)
        labels = [x.strip() for x in lines[end + 1].split(separator)] if lines[end + 1 :] else []
        labels = labels[: labels.index("Comment")] if "Comment" in labels else labels
        names = [unique for unique, label in zip(map(Names(), labels), labels, strict=True)
                 if label not in ("X_Value", "")]  # fmt: skip
        if parts and list(parts) != names:
            raise InputError("this segment has other channels than the first", file=path,
                             key=f"line {end + 2}", value=", ".join(names))  # fmt: skip
        rows = list(itertools.takewhile(str.strip, lines[end + 2 :]))
        begin = end + 2 + len(rows)
        table = _table(path, layout, labels, rows, end + 2)
        units |= dict(zip(names, head.get("Y_Unit_Label", []), strict=False))
        left += [x for x in table.left if columns != "No" or x.column != "X_Value"]
        for k, name in enumerate(names):
            values = table.columns[name].values
            own = "X_Value" if columns != "Multi" or not k else f"X_Value#{k + 1}"
            x = table.columns[own].values
            stamps = x[~np.isnan(x)]
            if columns == "No" or not stamps.size or (np.diff(stamps) <= 0).any():
                offset, step = (_of(head.get(key, []), k, decimal) for key in ("X0", "Delta_X"))
                if columns == "No" and not step > 0.0:
                    raise InputError("has neither an X column nor X0 and Delta_X of each channel",
                                     file=path, key=f"line {end + 1}")  # fmt: skip
                if step > 0.0:
                    x = np.nan_to_num(offset) + step * np.arange(values.size)
                if columns != "No":
                    told = ("the stamps of X_Value do not ascend: times by Delta_X",)
            there = ~(np.isnan(values) | np.isnan(x))
            parts.setdefault(name, []).append((x[there], values[there]))
    channels = {}
    for name, pairs in parts.items():
        x, values = (np.concatenate(column) for column in zip(*pairs, strict=True))
        channels[name] = RawChannel(name, values, x, units.get(name) or None)
    if not channels:
        raise InputError("holds no series of numbers", file=path)
    when = " ".join((said.get(key) or [""])[0].replace(",", ".") for key in ("Date", "Time"))
    return RawFile(path, "lvm", channels, None, moment(when), told, left=gathered(left))


def _said(lines: list[str], separator: str) -> dict[str, list[str]]:
    """The cells of a header by its keys."""
    cells = [[x.strip() for x in line.split(separator)] for line in lines]
    return {key: values for key, *values in cells}


def _of(cells: list[str], place: int, decimal: str) -> float:
    """A number that a header says of each channel, or of all; NaN of none."""
    try:
        return float(cells[min(place, len([x for x in cells if x]) - 1)].replace(decimal, "."))
    except (ValueError, IndexError):
        return np.nan


def _table(path: Path, layout: TextLayout, labels: list[str], rows: list[str], first: int) -> Table:
    """A segment's rows; a channel that is shorter than others has empty cells at its end."""
    width, separator = len(labels), layout.delimiter
    cells = [(row.split(separator) + [""] * width)[:width] for row in rows]
    text = "\n".join(separator.join(line) for line in [labels, *cells]) + "\n"
    parts = list(stream_blocks(io.StringIO(text), path, layout, first=first)) if rows else []
    if not parts:
        raise InputError("ends within a header", file=path, key=f"line {first}")
    return joined(parts)
