"""How a table fits the width there is: whole, in parts one below the other, or a block a row."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from textwrap import wrap
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderableType
    from rich.text import Text

_GAP = 2
_LEAST = 16  # prose is not squeezed into less
_LONGEST_WORD = 32  # in prose; what is longer, such as a path, may go on in the next line
_MOST_PARTS = 3  # more of them are harder to read than a block a row


@dataclass
class Row:
    """The cells of one row, and how it stands out."""

    cells: Sequence[Text]
    style: str | None = None


@dataclass(frozen=True)
class Column:
    """One column.

    Attributes:
        head: words above it, in lines.
        right: whether it is set to the right.
        wanted: characters of the longest line.
        needed: characters with less of which a number, a name or a word would be broken.
    """

    head: str
    right: bool
    wanted: int
    needed: int

    @classmethod
    def of(cls, head: str, cells: Sequence[Text], first: bool) -> Column:
        """Measure a column; names, in the first, and numbers, to the right, never wrap."""
        right, head = head.startswith(">"), head.removeprefix(">")
        longest = max((_longest(cell.plain.splitlines()) for cell in cells), default=0)
        word = max((_longest(cell.plain.split()) for cell in cells), default=0)
        needed = longest if first or right else max(min(word, _LONGEST_WORD), min(longest, _LEAST))
        wanted = max(longest, _longest(head.split("\n")))
        return cls(head, right, wanted, max(needed, _longest(head.split())))


@dataclass
class FittedTable:
    """A table of which no width breaks a number or a name.

    Attributes:
        heads: of the columns; one that begins with ">" is set to the right.
        rows: what stands below; the first cell names its row.
        title: a line above.
        caption: a line below.
        ruled: whether a line parts heads and rows.
        head_style: of the heads.
    """

    heads: Sequence[str]
    rows: Sequence[Row]
    title: str | None = None
    caption: str | None = None
    ruled: bool = True
    head_style: str = "bold"

    def columns(self) -> list[Column]:
        """The columns, measured."""
        cells = [[row.cells[k] for row in self.rows] for k in range(len(self.heads))]
        return [Column.of(head, cells[k], k == 0) for k, head in enumerate(self.heads)]

    def brief(self, console: Console, lines: int) -> tuple[FittedTable, bool]:
        """What of the table fits: the first columns and rows, and whether that is not all.

        Args:
            console: where it is printed.
            lines: that there are.
        """
        columns, kept = self.columns(), 1
        left = console.width - columns[0].needed
        while kept < len(columns) and (left := left - columns[kept].needed - _GAP) >= 0:
            kept += 1

        def of(count: int) -> FittedTable:
            rows = [Row(row.cells[:kept], row.style) for row in self.rows[:count]]
            rest = len(self.rows) - count
            more = f"... and {rest} more" if rest else self.caption
            return replace(self, heads=self.heads[:kept], rows=rows, caption=more)

        made = of(count := len(self.rows))
        while count > 1 and len(console.render_lines(made, pad=False)) - (not made.caption) > lines:
            made = of(count := max(1, count - max(1, count // 8)))
        return made, kept < len(columns) or count < len(self.rows)

    def __rich_console__(
        self, console: Console, options: ConsoleOptions
    ) -> Iterator[RenderableType]:
        from rich.text import Text

        width, columns = options.max_width, self.columns()
        if self.title:
            yield Text(self.title, style="bold")
        parts = parts_of(columns, width)
        for part in parts:
            yield self._part([(k, columns[k]) for k in part], width)
            yield Text("")
        if not parts:
            for row in self.rows:
                yield from _block(columns, row, width)
        if self.caption:
            yield Text(self.caption, style="italic")

    def _part(self, part: Sequence[tuple[int, Column]], width: int) -> RenderableType:
        """Some columns as a table; what room is left goes to the one that lacks most."""
        from rich import box
        from rich.table import Table

        widths = {k: column.needed for k, column in part}
        for _ in range(width - sum(widths.values()) - _GAP * (len(part) - 1)):
            lack, k = max((column.wanted - widths[k], k) for k, column in part)
            if lack <= 0:
                break
            widths[k] += 1
        made = Table(
            box=box.SIMPLE_HEAD if self.ruled else None,
            header_style=self.head_style,
            padding=(0, _GAP - self.ruled, 0, 0),  # the ruled one's columns are a space apart
            pad_edge=False,
            show_edge=False,
        )
        heads = {k: _wrapped(column.head, widths[k]) for k, column in part}
        lines = max(map(len, heads.values()))
        for k, column in part:
            head = [""] * (lines - len(heads[k])) + heads[k]  # at the bottom
            side: Literal["left", "right"] = "right" if column.right else "left"
            made.add_column("\n".join(head), justify=side, width=widths[k], overflow="fold")
        for row in self.rows:
            made.add_row(*(row.cells[k] for k, _ in part), style=row.style)
        return made


def parts_of(columns: Sequence[Column], width: int) -> list[list[int]]:
    """Which columns stand in each part of a table, the first of all before each.

    Args:
        columns: of the whole table.
        width: characters that there are.

    Returns:
        one part if all fit; none if a block a row is better.
    """
    room = width - columns[0].needed
    parts, left = [[0]], room
    for k, column in enumerate(columns[1:], start=1):
        if column.needed + _GAP > room:
            return []
        if column.needed + _GAP > left:
            parts.append([0])
            left = room
        parts[-1].append(k)
        left -= column.needed + _GAP
    return parts if room >= 0 and len(parts) <= _MOST_PARTS else []


def _block(columns: Sequence[Column], row: Row, width: int) -> Iterator[RenderableType]:
    """A row as a block: its name, then a line a column; what is too long goes below its head."""
    from rich.padding import Padding
    from rich.table import Table
    from rich.text import Text

    yield Text(row.cells[0].plain, style="bold", overflow="fold")
    heads = [" ".join(column.head.split()) for column in columns[1:]]
    beside = width - _longest(heads) - 2 * _GAP
    for head, cell in zip(heads, row.cells[1:], strict=True):
        if not cell.plain:
            continue
        if _longest(cell.plain.split()) <= beside:
            line = Table.grid(padding=(0, _GAP, 0, 0))
            line.add_column(width=_longest(heads))
            line.add_column(overflow="fold")
            line.add_row(Text(head, style="dim"), cell)
            yield Padding(line, (0, 0, 0, _GAP))
        else:
            yield Padding(Text(head, style="dim"), (0, 0, 0, _GAP))
            yield Padding(cell, (0, 0, 0, 2 * _GAP))
    yield Text("")


def _wrapped(head: str, width: int) -> list[str]:
    """A head's lines in a column of this width."""
    return [part for line in head.split("\n") for part in wrap(line, width) or [""]]


def _longest(texts: Sequence[str]) -> int:
    from rich.cells import cell_len

    return max(map(cell_len, texts), default=0)
