"""A record in a CSV file, read block by block."""

from __future__ import annotations

import csv
import re
import warnings
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np

from picchio.campaign.channels import Channel
from picchio.campaign.source import Block, Column, FileSource, Samples
from picchio.core.arrays import FloatArray
from picchio.core.errors import warn_user

_LONGEST_LINE = 1 << 20
_BYTES_A_VALUE = 20
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
        if ";" in text and "," not in text:
            raise self.error("columns must be separated by commas, not semicolons",
                             hint="`picchio import` reads other tables")  # fmt: skip
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


def write_csv(path: Path, channels: Sequence[Channel], blocks: Iterable[Samples]) -> None:
    """Write a record; floats are written such that they read back bit for bit."""
    with open(path, "w", encoding="utf-8", newline="") as stream:
        csv.writer(stream, lineterminator="\n").writerow([c.header for c in channels])
        for block in blocks:
            table = np.column_stack([block[channel.name] for channel in channels])
            stream.writelines(",".join(map(repr, row)) + "\n" for row in table.tolist())
