"""A record in a CSV file, read block by block."""

from __future__ import annotations

import codecs
import contextlib
import csv
import re
import warnings
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np

from picchio.campaign.channels import Channel
from picchio.campaign.source import Block, Column, FileSource, Layout, Samples
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError, warn_user
from picchio.core.files import regular_file
from picchio.core.tables import sniffed, table_blocks

_LONGEST_LINE = 1 << 20
_BYTES_A_VALUE = 20
_UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?|[+-]?(nan|inf|infinity)", re.I)


class CsvSource(FileSource):
    """A CSV file with the header `channel [unit]`; one line a sample, commas, points."""

    row_word = "line"
    first_row = 2

    def names(self) -> list[str]:
        """As `FileSource`."""
        with self._open() as stream:
            return self._header(stream)

    def _open(self) -> BinaryIO:
        try:
            return open(self.checked_path(), "rb")
        except OSError as error:
            raise self.error(f"cannot be read: {error.strerror}") from None

    def _header(self, stream: BinaryIO) -> list[str]:
        line = stream.readline(_LONGEST_LINE)
        if not line.strip():
            raise self.error("is empty" if not line else "the first line, the header, is empty")
        try:
            text = line.decode("utf-8-sig").rstrip("\r\n")
        except UnicodeDecodeError as error:
            raise self.error(f"is not UTF-8 text (byte {error.start})") from None
        if "\0" in text or len(line) == _LONGEST_LINE:
            raise self.error("is not a CSV file: its first line is no header")
        try:
            return next(csv.reader([text], strict=True))
        except csv.Error as error:
            raise self.error(f"the header is no CSV: {error}") from None

    def blocks(self, names: Sequence[str], size: int) -> Iterator[Block]:
        """As `Source`; a line that is ragged or holds no number is refused by its number."""
        columns = [self.columns[name] for name in names]
        with self._open() as stream:
            self._header(stream)
            first = 0
            while lines := stream.readlines(size * len(self.columns) * _BYTES_A_VALUE):
                table = self._parse_fast(b"".join(lines))
                if table is None:
                    table = self._parse_slowly(lines, first, stream)
                for start in range(0, len(table), size):
                    yield (
                        first + start,
                        self._converted(columns, table[start : start + size], first + start),
                    )
                first += len(table)
                if lines[-1][-1:] not in (b"\n", b"\r"):
                    place = self.error("has no line end: the file may have been cut short",
                                       sample=first - 1)  # fmt: skip
                    warn_user(str(place))

    def _converted(
        self, columns: list[Column], table: FloatArray, first: int
    ) -> dict[str, FloatArray]:
        found = {}
        for column in columns:
            name, values = column.channel.name, table[:, column.index]
            self.require_finite(name, values, first)
            found[name] = np.ascontiguousarray(column.convert(values))
        return found

    def _parse_fast(self, data: bytes) -> FloatArray | None:
        """All numbers of a block, (m, columns); None where a line holds anything else."""
        if not data.endswith(b"\n"):
            data += b"\n"
        data = data.replace(b"\r\n", b"\n")
        if b"\r" in data:  # numpy would take it for a space
            return None
        letters = np.frombuffer(data, np.uint8)
        ends = np.flatnonzero(letters == ord("\n"))
        commas = np.searchsorted(np.flatnonzero(letters == ord(",")), ends)
        if (np.diff(commas, prepend=0) != len(self.columns) - 1).any():
            return None
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                flat = np.fromstring(data[:-1].replace(b"\n", b",").decode("ascii"), sep=",")
            except (ValueError, DeprecationWarning):
                return None
        expected = ends.size * len(self.columns)
        return flat.reshape(-1, len(self.columns)) if flat.size == expected else None

    def _parse_slowly(self, lines: list[bytes], first: int, stream: BinaryIO) -> FloatArray:
        """Line by line: finds what is wrong, and reads quoted numbers."""
        rows: list[list[float]] = []
        blank = False
        for number, line in enumerate(lines):
            if not line.strip():
                blank = True
                continue
            if blank:
                raise self.error("an empty line stands between the samples",
                                 sample=first + len(rows))  # fmt: skip
            rows.append(self._row(line, first + number))
        if blank and stream.read(1):
            raise self.error("an empty line stands between the samples", sample=first + len(rows))
        return np.array(rows, dtype=np.float64).reshape(-1, len(self.columns))

    def _row(self, line: bytes, sample: int) -> list[float]:
        try:
            cells = next(csv.reader([line.decode("utf-8").rstrip("\r\n")], strict=True))
        except UnicodeDecodeError:
            raise self.error("is not UTF-8 text", sample=sample) from None
        except csv.Error as error:
            raise self.error(f"is no CSV: {error}", sample=sample) from None
        if len(cells) != len(self.columns):
            raise self.error(f"must have {len(self.columns)} values as the header has",
                             sample=sample, value=len(cells))  # fmt: skip
        names = list(self.columns)
        for name, cell in zip(names, cells, strict=True):
            if not cell.strip():
                raise self.error("the value is missing", channel=name, sample=sample)
            if not _NUMBER.fullmatch(cell.strip()):
                raise self.error("is not a number", channel=name, sample=sample, value=cell)
        return [float(cell) for cell in cells]


class TableSource(FileSource):
    """A table as a spreadsheet writes it: semicolons, tabs, decimal commas, another encoding."""

    row_word = "line"

    def names(self) -> list[str]:
        """As `FileSource`; a unit may stand in a line below the name."""
        self.table_layout = sniffed(self.checked_path())[0]
        table = next(table_blocks(self.path, self.table_layout))
        self.series, self.first_row = list(table.columns), int(table.lines[:1].sum()) or 2
        if not self.table_layout.header:
            raise self.error("the first line must name the columns", value=self.series)
        return [f"{c.name} [{c.unit}]" if c.unit else c.name for c in table.columns.values()]

    def blocks(self, names: Sequence[str], size: int) -> Iterator[Block]:
        """As `Source`; a line that is ragged or holds no number is refused by its number."""
        columns, first = [self.columns[name] for name in names], 0
        wanted = {self.series[column.index]: column for column in columns}
        for table in table_blocks(self.path, self.table_layout, size, numbers=self.series):
            for one in table.left:
                if one.column is None or one.column in wanted:
                    raise self.error(one.why, channel=one.column, value=one.text,
                                     sample=one.line - self.first_row)  # fmt: skip
            yield (
                first,
                {
                    c.channel.name: np.ascontiguousarray(c.convert(table.columns[name].values))
                    for name, c in wanted.items()
                },
            )
            first += table.lines.size


def text_source(path: Path, key: str, layout: Layout | None) -> FileSource:
    """The samples of a file of text: in the format's own habit, or as a spreadsheet writes it.

    Args:
        path: the file.
        key: the record's name in messages.
        layout: what its columns may be.

    Raises:
        InputError: as of `FileSource`.
    """
    head = b","
    with contextlib.suppress(InputError, OSError), open(regular_file(path), "rb") as stream:
        head = stream.readline(_LONGEST_LINE)
    plain = b"," in head or not (b";" in head or b"\t" in head)
    with contextlib.suppress(UnicodeDecodeError):
        head.decode("utf-8-sig")
        return CsvSource(path, key, layout) if plain else TableSource(path, key, layout)
    of_text = b"\0" not in head or head.startswith(_UTF16)
    return TableSource(path, key, layout) if of_text else CsvSource(path, key, layout)


def write_csv(path: Path, channels: Sequence[Channel], blocks: Iterable[Samples]) -> None:
    """Write a record; floats are written such that they read back bit for bit."""
    with open(path, "w", encoding="utf-8", newline="") as stream:
        csv.writer(stream, lineterminator="\n").writerow([c.header for c in channels])
        for block in blocks:
            table = np.column_stack([block[channel.name] for channel in channels])
            stream.writelines(",".join(map(repr, row)) + "\n" for row in table.tolist())
