"""CSV tables of any header, delimiter and decimal mark."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from picchio.campaign.importing.mapping import Mapping, SourceTable
from picchio.campaign.importing.raw import Names, RawChannel, RawFile
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.core.files import csv_rows, read_text

_LARGEST = 4 << 30


def read(path: Path, mapping: Mapping | None) -> RawFile:
    """All columns of numbers; a column that holds text is left out unless it is asked for.

    Raises:
        InputError: not UTF-8, empty, or a ragged line, with its number.
    """
    layout = mapping.source if mapping else _guess(path)
    lines = read_text(path, limit=_LARGEST).splitlines()[layout.skip_lines :]
    while lines and not lines[-1].strip():
        lines.pop()
    if not lines:
        raise InputError("is empty", file=path)
    rows = csv_rows(lines, path, delimiter=layout.delimiter, first=layout.skip_lines + 1)
    cells = [cell.strip() for cell in rows[0]]
    unique = Names()
    names = [unique(cell or str(i + 1)) for i, cell in enumerate(cells)]
    if not layout.header:
        names = [str(i + 1) for i in range(len(cells))]
    body = rows[1:] if layout.header else rows
    first_line = layout.skip_lines + (2 if layout.header else 1)
    for number, row in enumerate(body):
        if len(row) != len(names):
            raise InputError(f"must have {len(names)} values", file=path,
                             key=f"line {first_line + number}", value=len(row))  # fmt: skip
    wanted: set[str | None] = set()
    if mapping:
        wanted = {mapping.time.series, *(entry.series for entry in mapping.channel)}
    channels = {}
    for index, name in enumerate(names):
        column = [row[index] for row in body]
        values = _numbers(column, layout.decimal)
        if isinstance(values, int) and name in wanted:
            where = f"{name}, line {first_line + values}"
            raise InputError("is not a number", file=path, key=where, value=column[values])
        if not isinstance(values, int):
            channels[name] = RawChannel(name, values)
    return RawFile(path, "csv", channels)


def _numbers(cells: list[str], decimal: str) -> FloatArray | int:
    """The column's values, or the index of the first cell that is no number."""
    if decimal != ".":
        cells = [cell.replace(decimal, ".") for cell in cells]
    try:
        return np.array(cells, dtype=np.float64)
    except ValueError:
        for index, cell in enumerate(cells):
            try:
                float(cell)
            except ValueError:
                return index
        raise


def _guess(path: Path) -> SourceTable:
    """How the table seems to be written, for a template."""
    head = read_text(path, limit=_LARGEST).splitlines()[:1]
    line = head[0] if head else ""
    delimiter = max(",;\t", key=line.count)
    return SourceTable(
        delimiter=delimiter if line.count(delimiter) else ",",
        decimal="," if delimiter == ";" else ".",
    )
