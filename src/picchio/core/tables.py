"""Tables of text of any habit: one reader, which says what it could not read.

How a table is written (encoding, separator, decimal sign, header) is told from its first lines;
pandas parses it, a block of lines at a time. A line that has not the table's width and a cell that
holds no number are left out and told, never dropped.
"""

from __future__ import annotations

import csv
import io
import re
import warnings
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import islice
from pathlib import Path
from typing import IO, Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, Field

from picchio.core.arrays import FloatArray, IndexArray
from picchio.core.dates import MISSING, is_moment, moments
from picchio.core.errors import InputError
from picchio.core.files import regular_file
from picchio.core.toml import StrictModel
from picchio.core.units import Conversion, conversion, is_unit

BLOCK = 1 << 17
"""Rows that are parsed at a time."""
_HEAD = 1 << 18  # bytes that are looked at to tell how a table is written
_MOST = 1000  # lines of them
_LINES = 60  # of these, rows that are compared
_EXACT = 2.0**53
_SIGNS = {"\t": "tab", ";": "semicolon", ",": "comma", "|": "bar", " ": "blanks"}
_MARKS = {".": "point", ",": "comma"}
_COMMENTS = ("#", "%", "//", "!")
# Decimal sign, sign between thousands: what cells of numbers look like, the plainest first.
_HABITS = ((".", ""), (",", ""), (",", "."), (".", ","), (",", " "), (".", " "), (".", "'"))
_ENCODINGS = ["utf_16", "utf_16_le", "utf_16_be", "cp1252"]
_LOGICAL = {"true": "1", "false": "0"}


def _one_letter(value: str) -> str:
    if len(value) != 1:
        raise ValueError("must be one letter")
    return value


class TextLayout(StrictModel):
    """How a table of text is written.

    Attributes:
        delimiter: one letter between columns; a blank for any run of blanks.
        decimal: sign of decimal numbers.
        thousands: sign between thousands; none where empty.
        skip_lines: lines before the header (or the first sample).
        header: whether a line names the columns; without one they are "1", "2", ...
        units: whether a line below the header states the units.
        comment: lines that begin with this are left out; the header may be one.
        encoding: of its letters; told where left out.
    """

    delimiter: Annotated[str, AfterValidator(_one_letter)] = ","
    decimal: Literal[".", ","] = "."
    thousands: Literal["", ".", ",", " ", "'"] = ""
    skip_lines: Annotated[int, Field(ge=0, strict=True)] = 0
    header: bool = True
    units: bool = False
    comment: str | None = None
    encoding: str | None = None

    @property
    def told(self) -> str:
        """In words."""
        parts = [f"columns separated by {_SIGNS.get(self.delimiter, self.delimiter)}"]
        parts.append(f"decimal {_MARKS[self.decimal]}")
        if self.thousands:
            parts.append(f"{self.thousands!r} between thousands")
        parts.append(f"header in line {self.skip_lines + 1}" if self.header else "no header")
        if self.units:
            parts.append("a line of units below it")
        if self.comment:
            parts.append(f"lines that begin with {self.comment} left out")
        if self.encoding not in (None, "utf-8-sig"):
            parts.append(f"letters as in {self.encoding}")
        return ", ".join(parts)


@dataclass(frozen=True)
class Left:
    """What of a table is left out, for one reason.

    Attributes:
        why: in words.
        cells: how many values of the table are missing for it.
        line: where the first of them stands, from 1.
        text: the first of them, as it stands there.
        count: how many there are: lines, or cells.
        column: of the cells; None of whole lines.
        word: what a row is called.
    """

    why: str
    cells: int
    line: int
    text: str
    count: int
    column: str | None = None
    word: str = "line"

    @property
    def told(self) -> str:
        """In words."""
        text = self.text if len(self.text) <= 60 else self.text[:57] + "..."
        where = f"{text!r}" if text else "empty"
        where += f" in {self.word} {self.line}"
        if self.count > 1:
            what = "cells" if self.column is not None else f"{self.word}s"
            where = f"{self.count} {what}, the first {where}"
        return f"left out: {'' if self.column is None else self.column + ', '}{where}: {self.why}"


def gathered(found: Iterable[Left]) -> tuple[Left, ...]:
    """What several blocks of a table leave out, once for each reason and column.

    Args:
        found: in the order of the file.
    """
    sums: dict[tuple[str, str | None], Left] = {}
    for one in found:
        key = one.why, one.column
        first = sums.get(key)
        sums[key] = one if first is None else replace(
            first, cells=first.cells + one.cells, count=first.count + one.count
        )  # fmt: skip
    return tuple(sums.values())


@dataclass(frozen=True, eq=False)
class Column:
    """A column of a table.

    Attributes:
        name: unique in its table.
        kind: "number"; "date" and "day" (ns from 1970), "clock" (ns from midnight); "text".
        values: (m,) float64, int64 where a float would lose digits, NaN or `MISSING` where a cell
            holds none; of text the cells.
        unit: as a line of units says, or None.
        note: for people.
    """

    name: str
    kind: str
    values: Any
    unit: str | None = None
    note: str = ""


@dataclass(frozen=True, eq=False)
class Table:
    """A table, or a block of it.

    Attributes:
        path: its file.
        layout: how it is written.
        columns: by name.
        lines: (m,) the line in which each row stands, from 1.
        left: what is left out.
        told: what else there is to say.
    """

    path: Path
    layout: TextLayout
    columns: dict[str, Column]
    lines: IndexArray
    left: tuple[Left, ...] = ()
    told: tuple[str, ...] = ()

    @property
    def detected(self) -> tuple[str, ...]:
        """Its layout and what is left out, a sentence each."""
        return (self.layout.told, *self.told, *(one.told for one in self.left))


class Names:
    """Makes names unique by a trailing #2, #3, ..."""

    def __init__(self) -> None:
        self._seen: dict[str, int] = {}

    def __call__(self, name: str) -> str:
        """The name, or with its number where it was given out before."""
        self._seen[name] = self._seen.get(name, 0) + 1
        return name if self._seen[name] == 1 else f"{name}#{self._seen[name]}"


def read_table(path: str | Path, layout: TextLayout | None = None) -> Table:
    """A table of text, whole.

    Args:
        path: the file.
        layout: how it is written; told from its first lines where left out.

    Returns:
        its columns: of numbers, dates and text.

    Raises:
        InputError: missing, no text, or a table without a line of numbers.
    """
    parts = list(table_blocks(path, layout))
    if not parts:
        raise InputError("is empty", file=path)
    return joined(parts)


def read_columns(
    path: str | Path, needed: Sequence[str], optional: Sequence[str] = ()
) -> list[list[float]]:
    """Columns of numbers in SI, found by their names in the header.

    Args:
        path: the file.
        needed: names of columns with their SI units, such as "time [s]"; the file may have others.
        optional: further ones, which are read where the header has all of them.

    Returns:
        a list a row, in the order of the names.

    Raises:
        InputError: no such file, a column that is missing or there twice, a unit of something else,
            or a cell that is no finite number, with its line.
    """
    table = read_table(path)
    there = [(*_name_and_unit(re.sub(r"#\d+$", "", name)), name) for name in table.columns]
    wanted = [_name_and_unit(name) for name in (*needed, *optional)]
    if not {name for name, _ in wanted[len(needed) :]} <= {name for name, _, _ in there}:
        wanted = wanted[: len(needed)]
    found: dict[str, FloatArray] = {}
    for name, si in wanted:
        same = [one for one in there if one[0] == name and (one[1] is None) == (si is None)]
        if len(same) != 1:
            shown = name if si is None else f"{name} [{si}]"
            raise InputError(f"the header must name one column {shown!r}", file=path,
                             value=list(table.columns))  # fmt: skip
        column = table.columns[same[0][2]]
        try:
            scale = conversion(same[0][1] or "", (si,))[1] if si is not None else Conversion()
        except InputError as error:
            raise error.placed(file=path, key=column.name) from None
        bad = [one for one in table.left if one.column in (None, column.name)]
        if bad or column.kind != "number":
            line, text = (bad[0].line, bad[0].text) if bad else (table.lines[0], column.values[0])
            raise InputError(f"line {line} does not hold {len(wanted)} finite numbers", file=path,
                             value=text)  # fmt: skip
        found[column.name] = scale(column.values)
    return np.column_stack(list(found.values())).tolist()


def _name_and_unit(header: str) -> tuple[str, str | None]:
    name, bracket, rest = header.partition("[")
    return name.strip(), rest.rstrip("] ") if bracket else None


def joined(parts: Sequence[Table]) -> Table:
    """Blocks of a table as one.

    Args:
        parts: in their order.

    Returns:
        the whole table.
    """
    first = parts[0]
    if len(parts) == 1:
        return first
    columns = {
        name: replace(c, values=np.concatenate([part.columns[name].values for part in parts]))
        for name, c in first.columns.items()
    }
    return replace(first, columns=columns, lines=np.concatenate([part.lines for part in parts]),
                   left=gathered(one for part in parts for one in part.left))  # fmt: skip


def table_blocks(
    path: str | Path, layout: TextLayout | None = None, size: int = BLOCK, *,
    numbers: Collection[str] = (),
) -> Iterator[Table]:  # fmt: skip
    """The same in blocks of rows, so that memory does not grow with the file.

    What a column holds is told from the first block; in later ones it is the same.

    Args:
        path: the file.
        layout: how it is written.
        size: rows of a block, about.
        numbers: columns that are taken for numbers whatever they hold.

    Raises:
        InputError: as `read_table`.
    """
    source = regular_file(path)
    told: tuple[str, ...] = ()
    if layout is None:
        layout, told = sniffed(source)
    encoding = layout.encoding or encoding_of(source)
    layout = layout.model_copy(update={"encoding": encoding})
    try:
        with open(source, encoding=encoding, errors="replace") as stream:
            for _ in range(layout.skip_lines):
                stream.readline()
            yield from stream_blocks(stream, source, layout, size, layout.skip_lines + 1, told=told,
                                     numbers=numbers)  # fmt: skip
    except (LookupError, UnicodeError):
        raise InputError("is no encoding of text that is known", file=path, key="encoding",
                         value=encoding) from None  # fmt: skip


def stream_blocks(
    stream: IO[str], path: Path, layout: TextLayout, size: int = BLOCK, first: int = 1, *,
    told: tuple[str, ...] = (), numbers: Collection[str] = (),
) -> Iterator[Table]:  # fmt: skip
    """Blocks of a table that stands in a stream, from its header on.

    Args:
        stream: lines of text.
        path: of its file, for messages.
        layout: how it is written.
        size: rows of a block, about.
        first: number of the stream's first line in the file.
        told: what there is to say of it.
        numbers: columns that are taken for numbers whatever they hold.

    Returns:
        blocks of the table, in their order.
    """
    yield from _Reader(path, layout, told, numbers).blocks(stream, size, first)


def encoding_of(path: Path) -> str:
    """The encoding of a text file's letters: UTF-8, UTF-16, or else what Windows loggers write.

    Args:
        path: the file.
    """
    with open(path, "rb") as stream:
        head = stream.read(_HEAD)
    try:
        # The last letter may be cut.
        head[: len(head) - 4 * (len(head) == _HEAD)].decode("utf-8-sig")
        if b"\0" not in head:
            return "utf-8-sig"
    except UnicodeDecodeError as error:
        if len(head) - error.start < 4 and len(head) == _HEAD and b"\0" not in head:
            return "utf-8-sig"
    from charset_normalizer import from_bytes

    best = from_bytes(head, cp_isolation=_ENCODINGS).best()
    return "cp1252" if best is None else best.encoding


def cells_of(line: str, delimiter: str) -> list[str]:
    """The cells of a line; a blank stands for any run of blanks.

    Args:
        line: with or without its end.
        delimiter: one letter.
    """
    if delimiter == " ":
        return line.split()
    if '"' not in line:
        return [cell.strip() for cell in line.split(delimiter)]
    try:
        return [c.strip() for c in next(csv.reader([line], delimiter=delimiter), [""])]
    except csv.Error:  # a cell too long to be one
        return [line]


def _number(decimal: str, thousands: str = "") -> re.Pattern[str]:
    """What a number looks like."""
    digits = r"\d+"
    if thousands:
        digits = rf"(\d{{1,3}}([{thousands}]\d{{3}})+|\d+)"
    return re.compile(rf"[+-]?({digits}([{decimal}]\d*)?|[{decimal}]\d+)([eE][+-]?\d+)?")


_NOTHING = re.compile(r"|[+-]?(nan|inf|infinity|∞)|#?n/?a|null|none|-+", re.I)
_PATTERNS = {habit: _number(*habit) for habit in _HABITS}


def _wide(cells: list[str]) -> int:
    """How many cells a line has but for empty ones at its end."""
    while cells and not cells[-1]:
        cells = cells[:-1]
    return len(cells)


@dataclass
class _Trial:
    """How well lines fit a layout."""

    score: float
    layout: TextLayout
    told: tuple[str, ...]


def sniffed(path: Path) -> tuple[TextLayout, tuple[str, ...]]:
    """How a table of text is written, told from its first lines.

    Args:
        path: the file.

    Returns:
        the layout; what else there is to say.

    Raises:
        InputError: no line holds a number.
    """
    encoding = encoding_of(path)
    with open(path, encoding=encoding, errors="replace") as stream:
        lines = list(islice(iter(lambda: stream.readline(_HEAD), ""), _MOST))
    best: _Trial | None = None
    for order, delimiter in enumerate(_SIGNS):
        table = _Sample(lines, delimiter)
        for habit in _HABITS:
            found = table.tried(habit)
            if found is not None:
                found.score -= 0.01 * order + 0.001 * _HABITS.index(habit)
                if best is None or found.score > best.score:
                    best = found
    if best is None:
        raise InputError("holds no line of numbers" if any(map(str.strip, lines)) else "is empty",
                         file=path)  # fmt: skip
    return best.layout.model_copy(update={"encoding": encoding}), best.told


class _Sample:
    """The first lines of a table, taken apart at a delimiter."""

    def __init__(self, lines: list[str], delimiter: str) -> None:
        self.delimiter = delimiter
        self.rows: list[tuple[int, list[str]]] = []
        self.comments: list[tuple[int, str, list[str]]] = []
        for at, line in enumerate(lines):
            mark = next((c for c in _COMMENTS if line.lstrip().startswith(c)), None)
            if mark is not None:
                text = line.strip()[len(mark) :]
                self.comments.append((at, mark, cells_of(text, delimiter)))
            elif line.strip():
                self.rows.append((at, cells_of(line.rstrip("\r\n"), delimiter)))
        self.quoted = any('"' in line for line in lines)
        widths = Counter(len(cells) for _, cells in self.rows)
        self.width = max(widths, key=lambda w: (widths[w], w), default=0)

    def tried(self, habit: tuple[str, str]) -> _Trial | None:
        """How well the lines fit: columns of numbers, many of them; and the layout."""
        decimal, thousands = habit
        if not self.rows or (self.delimiter in habit and not self.quoted):
            return None
        number = _PATTERNS[habit].fullmatch

        def known(cell: str) -> bool:
            return number(cell) is not None or is_moment(cell)

        # Prose or comments may stand above: the numbers say what the rest is.
        full = [cells for _, cells in self.rows if len(cells) == self.width][-_LINES:]
        shares = [sum(map(known, column)) for column in zip(*full, strict=True)]
        usual = [2 * n >= sum(not _NOTHING.fullmatch(c) for c in column) and n > 0
                 for n, column in zip(shares, zip(*full, strict=True), strict=True)]  # fmt: skip
        if not any(usual):
            return None

        def numbers(k: int) -> bool:
            cells = self.rows[k][1]
            own = [c for c, u in zip(cells, usual, strict=False) if u and not _NOTHING.fullmatch(c)]
            if not own:
                return any(cells) and len(cells) == self.width
            # A header may be called "1", but not all of it.
            return known(own[0]) and 2 * sum(map(known, own)) >= len(own)

        def row(k: int) -> bool:
            return len(self.rows[k][1]) == self.width and numbers(k)

        # The first line of numbers that another follows: prose above may hold a number, too.
        last = len(self.rows)
        begin = next((k for k in range(last) if row(k) and (k + 1 == last or row(k + 1))), None)
        if begin is None:
            return None
        # Rows right above it may be cut: the table begins with a row, or below its header.
        top = next((k + 1 for k in reversed(range(begin)) if not numbers(k)), 0)
        if row(top) or (top and len(self.rows[top - 1][1]) == self.width):
            begin = top
        below = self.rows[begin : begin + _LINES]
        body = [cells for _, cells in below if len(cells) == self.width]
        if decimal == "," or thousands:
            signs = "".join(cell for cells in body for cell in cells if number(cell))
            if not all(sign in signs for sign in (decimal if decimal == "," else "", thousands)):
                return None  # no number has one: the plainer habit is as good
        # Lines of another width would be lost.
        filled = sum(not _NOTHING.fullmatch(c) for cells in body for c in cells) / len(below)
        told = sum(map(known, (c for cells in body for c in cells))) / len(below)
        # A blank is a separator only where nothing else is; a column of text costs a little.
        score = told - 0.1 * (filled - told)
        layout, more = self._head(begin, max(map(_wide, body)), known)
        how = {"delimiter": self.delimiter, "decimal": decimal, "thousands": thousands}
        return _Trial(score, TextLayout(**how, **layout), more)

    def _head(self, begin: int, width: int, known: Any) -> tuple[dict[str, Any], tuple[str, ...]]:
        """Where the header stands, and the line of units."""
        above = [(at, cells) for at, cells in self.rows[:begin]][-2:]
        first = self.rows[begin][0]
        notes = [(at, mark, cells) for at, mark, cells in self.comments if at < first]
        mark = next((m for _, m, _ in self.comments), None)
        fitting = [_wide(cells) == width or len(cells) == self.width for _, cells in above]
        told: tuple[str, ...] = ()
        if above and fitting[-1]:
            units = (
                len(above) == 2 and all(fitting) and are_units(above[1][1])
                and not any(map(known, above[0][1]))
            )  # fmt: skip
            skip = above[0][0] if units else above[-1][0]
            inside = any(at > skip for at, _, _ in self.comments)
            return {"header": True, "units": units, "skip_lines": skip,
                    "comment": mark if inside else None}, told  # fmt: skip
        if above and _wide(above[-1][1]) > 1:
            at, cells = above[-1]
            told = (f"line {at + 1} has {_wide(cells)} cells and the rows {width}: not taken as "
                    "the header",)  # fmt: skip
        named = [at for at, _, cells in notes if _wide(cells) == width and width > 1
                 and not all(map(known, cells))]  # fmt: skip
        if named and not above:
            return {"header": True, "skip_lines": named[-1], "comment": mark}, told
        inside = any(at > first for at, _, _ in self.comments)
        return {"header": False, "skip_lines": first, "comment": mark if inside else None}, told


def are_units(cells: Sequence[str]) -> bool:
    """Whether a line looks like one of units: short, and bracketed or units that are known.

    Args:
        cells: of the line.
    """
    short = [c.strip("[]()") for c in cells if c]
    return bool(short) and all(len(c) <= 12 for c in short) and any(
        c[0] + c[-1] in ("[]", "()") or is_unit(c) for c in cells if c
    )  # fmt: skip


class _Reader:
    """Parses a table block by block, and keeps what its first block shows."""

    def __init__(
        self, path: Path, layout: TextLayout, told: tuple[str, ...], numbers: Collection[str]
    ) -> None:
        self.path, self.layout, self.told = path, layout, told
        self.names: list[str] = []
        self.header: list[str] = []
        self.units: list[str | None] = []
        self.kinds, self.started = dict.fromkeys(numbers, "number"), False
        self.sep = layout.delimiter

    def blocks(self, stream: IO[str], size: int, first: int) -> Iterator[Table]:
        head: list[str] = []
        wanted = self.layout.header + self.layout.units
        while sum(map(self._counts, head)) <= wanted and (line := stream.readline()):
            head.append(line)
        if not any(map(self._counts, head)):
            return
        taken = self._named(head)
        lines, first, hint = head[taken:], first + taken, 0
        while lines or (lines := stream.readlines(hint)):
            # About as many lines as are wanted: those before say how long one is.
            hint = max(1, size * sum(map(len, lines)) // len(lines))
            if hint > 1 and len(lines) < size // 2:
                lines += stream.readlines(max(1, hint - sum(map(len, lines))))
            made = self._block(lines, first)
            first, lines = first + len(lines), []
            if made is not None:
                yield made

    def _counts(self, line: str) -> bool:
        """Whether a line is neither blank nor a comment."""
        mark = self.layout.comment
        return not line.isspace() and not (mark and line.lstrip().startswith(mark))

    def _named(self, head: list[str]) -> int:
        """Take the names and units from the first lines; how many lines those are."""
        layout = self.layout
        at = [k for k, line in enumerate(head) if self._counts(line)]
        cells = [cells_of(head[k].rstrip("\r\n"), self.sep) for k in at]
        count = layout.header + layout.units
        if layout.header and layout.comment and at[0]:
            noted = cells_of(head[at[0] - 1].strip()[len(layout.comment) :], self.sep)
            number = _PATTERNS[(layout.decimal, layout.thousands)].fullmatch
            data = any(number(c) or is_moment(c) for c in cells[0])
            if data and _wide(noted) == _wide(cells[0]):
                cells, count = [noted, *cells], layout.units
        body = cells[layout.header + layout.units :]
        self.header = cells[0] if layout.header else []
        width = max(_wide(self.header), 1) if self.header else max(map(len, body), default=0)
        if self.header and body and width < _wide(body[0]) <= len(self.header):
            width = len(self.header)  # a last column without a name
        unique = Names()
        names = self.header[:width] or [""] * width
        self.names = [unique(name or str(i + 1)) for i, name in enumerate(names)]
        units = [u.strip(" []()") or None for u in cells[1]] if layout.units else []
        self.units = [*units, *[None] * width][:width]
        return at[count] if count < len(at) else len(head)

    def _block(self, lines: list[str], first: int) -> Table | None:
        width, left = len(self.names), []
        rows, kept, wrong = self._rows(lines)
        numbers = first + kept
        for why, several in wrong.items():
            at = several[0]
            left.append(Left(why, len(several) * width, first + at, lines[at].strip(),
                             len(several)))  # fmt: skip
        if not rows and not self.started:
            if not left:
                return None
            raise InputError(f"has not {width} cells, as the header has", file=self.path,
                             key=f"line {left[0].line}", value=left[0].text[:60])  # fmt: skip
        self.started = True
        columns: dict[str, Column] = {}
        frame = self._parsed(rows, width)
        for index, name in enumerate(self.names):
            made = self._column(index, name, frame[index], rows)
            columns[name] = made
            gone = np.flatnonzero(self._gone(made))
            if gone.size:
                text, line = self._cell(rows[gone[0]], index), int(numbers[gone[0]])
                left.append(Left("no number", gone.size, line, text,
                                 gone.size, name))  # fmt: skip
        return Table(self.path, self.layout, columns, numbers, tuple(left), self.told)

    @staticmethod
    def _gone(column: Column) -> Any:
        if column.kind == "text":
            return np.zeros(len(column.values), bool)
        if column.values.dtype.kind == "f":
            return np.isnan(column.values)
        return column.values == MISSING

    def _cell(self, line: str, index: int) -> str:
        cells = cells_of(line.rstrip("\r\n"), self.sep)
        return cells[index] if index < len(cells) else ""

    def _rows(self, lines: list[str]) -> tuple[list[str], IndexArray, dict[str, list[int]]]:
        """Lines that are rows and which they are; which of the others, by the reason."""
        width, sep, text = len(self.names), self.sep, "".join(lines)
        if sep == " ":
            odd = {k for k, line in enumerate(lines) if len(line.split()) != width}
        else:
            odd = {k for k, line in enumerate(lines) if line.count(sep) != width - 1}
        if width == 1:
            odd |= {k for k, line in enumerate(lines) if line.isspace()}
        start = self.header[0] if self.header else ""
        again = bool(start) and (text.startswith(start) or f"\n{start}" in text)
        for mark in ('"', self.layout.comment, start if again else None):
            if mark and mark in text:
                odd |= {k for k, line in enumerate(lines) if mark in line}
        if not odd:
            return lines, np.arange(len(lines)), {}
        wrong: dict[str, list[int]] = {}
        kept, rows = np.ones(len(lines), bool), list(lines)
        for k in sorted(odd):
            cells = cells_of(lines[k].rstrip("\r\n"), sep)
            why = None
            kept[k] = self._counts(lines[k])
            if not kept[k]:
                continue
            if self.header and cells[:width] == self.header[:width]:
                why = "the header again"
            elif _wide(cells) > width or len(cells) < width:
                why = f"not {width} cells"
            elif lines[k].count('"') % 2:
                why = "a quote is not closed"
            elif len(cells) > width:  # empty cells at its end
                rows[k] = self._joined(cells[:width])
            if why is not None:
                kept[k] = False
                wrong.setdefault(why, []).append(k)
        at = np.flatnonzero(kept)
        return [rows[k] for k in at], at, wrong

    def _joined(self, cells: list[str]) -> str:
        plain = self.sep.join(cells)
        if plain.count(self.sep) == len(cells) - 1 and '"' not in plain:
            return plain + "\n"
        out = io.StringIO()
        csv.writer(out, delimiter=self.sep, lineterminator="\n").writerow(cells)
        return out.getvalue()

    def _parsed(self, lines: list[str], width: int) -> Any:
        """What pandas makes of rows of one width."""
        import pandas

        if not lines:
            return pandas.DataFrame({k: np.empty(0) for k in range(width)})
        if not lines[-1].endswith("\n"):
            lines = [*lines[:-1], lines[-1] + "\n"]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # mixed types are looked at below
            return pandas.read_csv(
                io.StringIO("".join(lines)), header=None, names=range(width), index_col=False,
                sep=r"\s+" if self.sep == " " else self.sep, decimal=self.layout.decimal,
                skip_blank_lines=False, skipinitialspace=True, low_memory=False,
                **_float_precision(),
            )  # fmt: skip

    def _column(self, index: int, name: str, cells: Any, lines: list[str]) -> Column:
        """A column of what its kind is, which its first block decides."""
        kind, unit = self.kinds.get(name), self.units[index]
        values = cells.to_numpy() if cells.dtype.kind in "iufb" else None
        if values is not None and kind in (None, "number"):
            self.kinds[name] = "number"
            if values.dtype.kind == "i" and values.size and np.abs(values[[0, -1]]).max() >= _EXACT:
                return Column(name, "number", values, unit)
            values = values.astype(np.float64)
            values[~np.isfinite(values)] = np.nan
            return Column(name, "number", values, unit)
        text = [
            cell.strip() if isinstance(cell, str) else self._cell(line, index)
            for cell, line in zip(cells.to_numpy(dtype=object), lines, strict=True)
        ]
        found = typed(name, text, (self.layout.decimal, self.layout.thousands), kind, unit)
        self.kinds[name] = found.kind
        return found


def typed(
    name: str, cells: list[str], habit: tuple[str, str] = (".", ""), kind: str | None = None,
    unit: str | None = None,
) -> Column:  # fmt: skip
    """Cells of text as what most of them are: numbers, dates, times of day, or text.

    Args:
        name: of the column.
        cells: without blanks around them.
        habit: decimal sign, sign between thousands.
        kind: what they are, where that is known.
        unit: of the numbers.

    Returns:
        the column.
    """
    made = [_LOGICAL.get(cell.lower(), cell) for cell in cells]
    number = _PATTERNS[habit].fullmatch
    there = np.array([number(cell) is not None for cell in made], bool)
    asked = np.array([_NOTHING.fullmatch(cell) is None for cell in made], bool)
    if kind in (None, "date", "day", "clock"):
        first = next((cell for cell, ask in zip(made, asked, strict=True) if ask), "")
        if kind is not None or (is_moment(first) and not number(first)):
            told, ns, note = moments(made)
            if kind is not None or 2 * int((ns != MISSING).sum()) > int(asked.sum()):
                return Column(name, kind or told, ns, "ns", note)
    if kind == "text" or (kind is None and 2 * int(there.sum()) < int(asked.sum())):
        return Column(name, "text", np.array(cells, dtype=object), unit)
    decimal, thousands = habit
    plain = [cell for cell, t in zip(made, there, strict=True) if t]
    if thousands:
        plain = [cell.replace(thousands, "") for cell in plain]
    values = np.full(len(cells), np.nan)
    if decimal != ".":
        plain = [cell.replace(decimal, ".") for cell in plain]
    values[there] = np.array(plain, dtype=np.float64)
    values[~np.isfinite(values)] = np.nan
    return Column(name, "number", values, unit)


@cache
def _float_precision() -> dict[str, Any]:
    """How pandas is told to read floats bit for bit, which it does by itself from 3.1 on."""
    import pandas

    version = tuple(int(part) for part in pandas.__version__.split(".")[:2])
    return {} if version >= (3, 1) else {"float_precision": "round_trip"}
