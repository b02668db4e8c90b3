"""A record in a file of text, read block by block."""

from __future__ import annotations

import codecs
import contextlib
import csv
import math
import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from picchio.campaign.channels import Channel
from picchio.campaign.source import Block, FileSource, Samples
from picchio.core.errors import InputError, warn_user
from picchio.core.tables import Left, TextLayout, cells_of, sniffed, table_blocks

_LONGEST_LINE = 1 << 20
_UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_PLAIN = TextLayout(header=False, skip_lines=1, encoding="utf-8-sig")


class TextSource(FileSource):
    """A table with the header `channel [unit]`; one line a sample, commas, points.

    A table as a spreadsheet writes it (semicolons, tabs, decimal commas, another encoding) is read
    likewise; a unit may then stand in a line below the name, and blank lines are no samples.
    """

    row_word = "line"

    def names(self) -> list[str]:
        """As `FileSource`."""
        path = self.checked_path()
        try:
            with open(path, "rb") as stream:
                head = stream.readline(_LONGEST_LINE)
        except OSError as error:
            raise self.error(f"cannot be read: {error.strerror}") from None
        if not head.strip():
            raise self.error("is empty" if not head else "the first line, the header, is empty")
        try:
            text = head.decode("utf-8-sig").rstrip("\r\n")
        except UnicodeDecodeError as error:
            if b"\0" in head and not head.startswith(_UTF16):
                raise self.error(f"is not UTF-8 text (byte {error.start})") from None
            return self._told_names()
        if "\0" in text or len(head) == _LONGEST_LINE:
            raise self.error("is not a CSV file: its first line is no header")
        if "," not in text and (";" in text or "\t" in text):
            return self._told_names()
        self.text_layout, self.first_row = _PLAIN, 2
        names = cells_of(text, ",")
        self.series = [str(number) for number, _ in enumerate(names, start=1)]
        return names

    def _told_names(self) -> list[str]:
        """The names of a table whose layout is told from its first lines."""
        self.text_layout = sniffed(self.path)[0]
        table = next(table_blocks(self.path, self.text_layout))
        self.series, self.first_row = list(table.columns), int(table.lines[:1].sum()) or 2
        if not self.text_layout.header:
            raise self.error("the first line must name the columns", value=self.series)
        return [f"{c.name} [{c.unit}]" if c.unit else c.name for c in table.columns.values()]

    def blocks(self, names: Sequence[str], size: int) -> Iterator[Block]:
        """As `Source`; a line that is ragged or holds no number is refused by its number."""
        columns = [self.columns[name] for name in names]
        wanted = {self.series[c.index]: c.channel.name for c in columns}
        first, plain, before = 0, self.text_layout is _PLAIN, self.first_row - 1
        for table in table_blocks(self.path, self.text_layout, size, numbers=self.series):
            if len(table.columns) != len(self.series):
                raise self.error(f"must have {len(self.series)} values as the header has",
                                 sample=first, value=len(table.columns))  # fmt: skip
            for one in sorted(table.left, key=lambda one: one.line):
                if one.column is None or one.column in wanted:
                    raise self._refused(one, wanted.get(one.column or ""))
            if plain and (np.diff(table.lines, prepend=before) > 1).any():
                gap = int(np.argmax(np.diff(table.lines, prepend=before) > 1))
                raise self.error("an empty line stands between the samples", sample=first + gap)
            found = {
                c.channel.name: c.convert(table.columns[self.series[c.index]].values)
                for c in columns
            }
            for start in range(0, table.lines.size, size):
                part = slice(start, start + size)
                yield first + start, {name: values[part] for name, values in found.items()}
            first, before = first + table.lines.size, int(table.lines[-1:].sum())
        if plain and first:
            with open(self.path, "rb") as stream:
                stream.seek(-1, os.SEEK_END)
                if stream.read(1) not in b"\r\n":
                    place = self.error("has no line end: the file may have been cut short",
                                       sample=first - 1)  # fmt: skip
                    warn_user(str(place))

    def _refused(self, one: Left, channel: str | None) -> InputError:
        """What the reader of tables left out, as what is wrong with this file."""
        sample, text = one.line - self.first_row, one.text
        if "\ufffd" in text:
            return self.error("is not UTF-8 text", channel=channel, sample=sample)
        if channel is None:
            problem = f"must have {len(self.series)} values as the header has: {one.why}"
            return self.error(problem, sample=sample, value=text)
        if not text:
            return self.error("the value is missing", channel=channel, sample=sample)
        with contextlib.suppress(ValueError):
            if not math.isfinite(float(text)):
                return self.error("is not a finite number", channel=channel, sample=sample,
                                  value=float(text))  # fmt: skip
        return self.error("is not a number", channel=channel, sample=sample, value=text)


def write_csv(path: Path, channels: Sequence[Channel], blocks: Iterable[Samples]) -> None:
    """Write a record; floats are written such that they read back bit for bit."""
    with open(path, "w", encoding="utf-8", newline="") as stream:
        csv.writer(stream, lineterminator="\n").writerow([c.header for c in channels])
        for block in blocks:
            table = np.column_stack([block[channel.name] for channel in channels])
            stream.writelines(",".join(map(repr, row)) + "\n" for row in table.tolist())
