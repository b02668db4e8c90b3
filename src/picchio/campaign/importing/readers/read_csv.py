"""CSV tables of any header, delimiter and decimal mark."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from picchio.campaign.importing.detect import layout as found_layout
from picchio.campaign.importing.detect import moment, split
from picchio.campaign.importing.mapping import Mapping, SourceTable
from picchio.campaign.importing.raw import Names, RawChannel, RawFile
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.core.files import csv_rows, read_text, regular_file

_LARGEST = 4 << 30
_EXACT = 2.0**53
_BYTES_A_LINE = 60
_DATE = len("2026-03-01T08:00:00")
_SIGNS = {",": "comma", ";": "semicolon", "\t": "tab", " ": "blanks", "|": "bar"}
_MARKS = {".": "point", ",": "comma"}


def layout_of(path: Path, mapping: Mapping | None) -> SourceTable:
    """How a table is written: as the mapping says, or as it seems.

    Args:
        path: the file.
        mapping: with or without a layout.
    """
    return mapping.source if mapping and mapping.source.stated else found_layout(path)


def told(layout: SourceTable) -> str:
    """A layout in words.

    Args:
        layout: of a table.
    """
    parts = [f"columns separated by {_SIGNS.get(layout.delimiter, layout.delimiter)}"]
    parts.append(f"decimal {_MARKS[layout.decimal]}")
    parts.append(f"header in line {layout.skip_lines + 1}" if layout.header else "no header")
    if layout.units:
        parts.append("a line of units below it")
    if layout.comment:
        parts.append(f"lines that begin with {layout.comment} left out")
    return ", ".join(parts)


def read(path: Path, mapping: Mapping | None) -> RawFile:
    """All columns of numbers; a column that holds text is left out unless it is asked for.

    Raises:
        InputError: not UTF-8, empty, or a ragged line, with its number.
    """
    layout = layout_of(path, mapping)
    lines = read_text(path, limit=_LARGEST).splitlines()
    return _table(path, lines, layout, mapping)


def _table(
    path: Path, all_lines: list[str], layout: SourceTable, mapping: Mapping | None, shift: int = 0
) -> RawFile:
    lines = all_lines[layout.skip_lines :]
    while lines and not lines[-1].strip():
        lines.pop()
    numbers = range(layout.skip_lines + 1, layout.skip_lines + 1 + len(lines))
    kept = list(zip(numbers, lines, strict=True))
    if layout.comment:
        kept = [(n, x) for n, x in kept if not x.lstrip().startswith(layout.comment)]
    if not kept:
        raise InputError("is empty", file=path)
    if layout.delimiter == " ":
        rows = [split(line, " ") for _, line in kept]
    else:
        texts = [line for _, line in kept]
        rows = csv_rows(texts, path, delimiter=layout.delimiter, first=kept[0][0])
    cells = [cell.strip() for cell in rows[0]]
    unique = Names()
    names = [unique(cell or str(i + 1)) for i, cell in enumerate(cells)]
    if not layout.header:
        names = [str(i + 1) for i in range(len(cells))]
    skip = layout.header + layout.units
    units = _units(rows[1] if layout.units and len(rows) > 1 else [], len(names))
    body, places = rows[skip:], [n + shift for n, _ in kept[skip:]]
    if len(body) != len(places):
        raise InputError("a quoted cell goes over several lines, or its quote is not closed",
                         file=path)  # fmt: skip
    for number, row in zip(places, body, strict=True):
        if len(row) != len(names):
            raise InputError(f"must have {len(names)} values", file=path,
                             key=f"line {number}", value=len(row))  # fmt: skip
    wanted: set[str | None] = set()
    if mapping:
        wanted = {mapping.time.series, *(s for _, _, parts, _ in mapping.entries for s in parts)}
    channels = {}
    for index, name in enumerate(names):
        column = [row[index].strip() for row in body]
        values = _numbers(column, layout.decimal)
        if isinstance(values, int):
            dates = _dates(column)
            if dates is not None:
                channels[name] = RawChannel(name, dates, unit="ns", note="dates as text")
            elif name in wanted:
                where = f"{name}, line {places[values]}"
                raise InputError("is not a number", file=path, key=where, value=column[values])
        else:
            channels[name] = RawChannel(name, values, unit=units[index])
    return RawFile(path, "csv", channels, detected=(told(layout),))


def _numbers(cells: list[str], decimal: str) -> FloatArray | int:
    """The column's values, or the index of the first cell that is no number."""
    if decimal != ".":
        cells = [cell.replace(decimal, ".") for cell in cells]
    if "" in cells and any(cells):
        cells = [cell or "nan" for cell in cells]
    try:
        values = np.array(cells, dtype=np.float64)
    except ValueError:
        for index, cell in enumerate(cells):
            try:
                float(cell)
            except ValueError:
                return index
        raise
    if values.size and abs(values[0]) >= _EXACT:  # nanoseconds since 1970
        try:
            return np.array([int(cell) for cell in cells], dtype=np.int64)
        except (ValueError, OverflowError):
            return values
    return values


def _dates(cells: list[str]) -> FloatArray | None:
    """The column as ns from 1970, where every cell is a date and time."""
    if not cells or moment(cells[0]) is None:
        return None
    if min(map(len, cells)) >= _DATE and cells[0][4] == "-" and not set("+-") & set(cells[0][10:]):
        try:  # UTC, with or without a Z: a hundred times as fast
            return np.array([c.rstrip("Z") for c in cells], "datetime64[ns]").astype(np.int64)
        except ValueError:
            pass
    found = [moment(cell) for cell in cells]
    return None if None in found else np.array(found, dtype=np.int64)


def blocks(path: Path, mapping: Mapping | None, size: int) -> Iterator[RawFile]:
    """The same, in blocks of so many lines: memory does not grow with the file.

    Args:
        path: the file.
        mapping: whose series are needed; None takes what are numbers.
        size: lines.

    Raises:
        InputError: as `read`.
    """
    layout = layout_of(path, mapping)
    plain = SourceTable(**{**layout.model_dump(), "skip_lines": 0})
    with open(regular_file(path), encoding="utf-8-sig") as stream:
        try:
            for _ in range(layout.skip_lines):
                stream.readline()
            head: list[str] = []
            number = layout.skip_lines
            while len(head) < layout.header + layout.units and (line := stream.readline()):
                number += 1
                if not (layout.comment and line.lstrip().startswith(layout.comment)):
                    head.append(line)
            while lines := stream.readlines(size * _BYTES_A_LINE):
                made = _fast(path, head, lines, layout)
                if made is None:  # text, dates, empty cells, or an error: this says where
                    shift = number - len(head)
                    made = _table(path, [*head, *lines], plain, mapping, shift)
                yield made
                number += len(lines)
        except UnicodeDecodeError:
            raise InputError("is not UTF-8 text", file=path) from None


def _fast(path: Path, head: list[str], lines: list[str], layout: SourceTable) -> RawFile | None:
    """A block of nothing but numbers; None where there is anything else."""
    import pandas

    if layout.comment is not None:
        return None
    separator = r"\s+" if layout.delimiter == " " else layout.delimiter
    cells = len(split(lines[0].rstrip("\r\n"), layout.delimiter))
    try:
        frame = pandas.read_csv(
            io.StringIO("".join(lines)), header=None, sep=separator, decimal=layout.decimal,
            keep_default_na=False,
        )  # fmt: skip
    except ValueError:
        return None
    if frame.shape != (len(lines), cells) or any(t.kind not in "if" for t in frame.dtypes):
        return None
    columns = []
    for _, column in frame.items():
        values = column.to_numpy()
        # Whole numbers that a float would cut, such as ns since 1970, stay whole.
        if values.dtype.kind == "f" or abs(int(values[0])) < _EXACT:
            values = values.astype(np.float64)
            if not np.isfinite(values).all() or abs(values[0]) >= _EXACT:
                return None
        columns.append(values)
    names = _names(head, cells, layout)
    if len(names) != cells:
        return None
    units = _units(split(head[1].rstrip("\r\n"), layout.delimiter) if layout.units else [], cells)
    channels = {n: RawChannel(n, c, unit=u) for n, c, u in zip(names, columns, units, strict=True)}
    return RawFile(path, "csv", channels, detected=(told(layout),))


def _units(cells: list[str], columns: int) -> list[str | None]:
    """The units that a line states; none where it has not as many cells as there are columns."""
    found = [cell.strip(" []()") or None for cell in cells]
    return found if len(found) == columns else [None] * columns


def _names(head: list[str], cells: int, layout: SourceTable) -> list[str]:
    if not layout.header:
        return [str(i + 1) for i in range(cells)]
    unique = Names()
    found = split(head[0].rstrip("\r\n"), layout.delimiter)
    return [unique(cell or str(i + 1)) for i, cell in enumerate(found)]
