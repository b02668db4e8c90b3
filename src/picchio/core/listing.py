"""A table as people read it, said once for a terminal, a notebook and a page."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from picchio.core import spoken

_HEAD = re.compile(r"(?P<name>.*?)(?: \[(?P<unit>.*)\])?$", re.DOTALL)
# What is set to the right: a number, an interval, up to three of them, or the word for one.
_NUMBER = re.compile(r"(?!(.*, ){3})([-+<>] ?)?\d|unlimited|unknown|about 0")
_NONE = ("", "-", "–")

Key = str | Callable[[Any], Any]
"""Where a cell is in a record: a key or attribute, or a function of the record."""


class InUnit(NamedTuple):
    """A number of a column in which not all have the same unit.

    Attributes:
        value: a number, or text that tells it.
        unit: of this one.
    """

    value: float | str
    unit: str


@dataclass(frozen=True)
class Column:
    """One column of a listing.

    Attributes:
        name: in a few words.
        unit: what most of its numbers are in; "" for none.
        cells: text, numbers, flags, sequences of numbers, quantities; None where there is none.
    """

    name: str
    unit: str
    cells: tuple[Any, ...]

    @property
    def head(self) -> str:
        """Name and unit in one line."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    def told(self, tell: Callable[[Any], str]) -> list[str]:
        """The cells as text; those with a unit of their own say so.

        Args:
            tell: writes a number, None or a sequence.
        """
        texts = []
        for cell in self.cells:
            value, unit = cell if isinstance(cell, InUnit) else (cell, self.unit)
            text = value if isinstance(value, str) else tell(value)
            texts.append(text if unit == self.unit or text in _NONE else f"{text} {unit}")
        return texts

    @property
    def numbers(self) -> bool:
        """Whether it is set to the right: most of what it holds are numbers."""
        held = [text for text in self.told(plainly) if text not in _NONE]
        return 2 * sum(bool(_NUMBER.match(text)) for text in held) >= len(held)


@dataclass(frozen=True)
class Listing:
    """A table as people read it; what shows it says how many digits its numbers have.

    Attributes:
        title: what it lists.
        columns: the first names the rows.
        bold: the name of the row that stands out; None for none.
        facts: {name with unit: value} of all of it, for a notebook.
        note: a sentence below, likewise.
        head: what matters, likewise; the result's own headline if empty.
    """

    title: str
    columns: tuple[Column, ...]
    bold: str | None = None
    facts: Mapping[str, Any] = field(default_factory=dict)
    note: str = ""
    head: str = ""

    @classmethod
    def of(
        cls,
        title: str,
        records: Iterable[Any],
        columns: Mapping[str, Key] | Iterable[tuple[str, Key]],
        **more: Any,
    ) -> Listing:
        """A row a record.

        Args:
            title: what it lists.
            records: objects or mappings.
            columns: {name, with the unit in brackets: the cell's key in a record, or a function
                of the record}; in pairs where names may be the same.
            **more: of the listing, such as `bold`.

        Returns:
            the listing; the unit of a column of quantities is what most of them have.
        """
        every, made = list(records), []
        for head, key in columns.items() if isinstance(columns, Mapping) else columns:
            cells = [_cell(record, key) for record in every]
            found = _HEAD.match(head)
            assert found is not None
            units = Counter(cell.unit for cell in cells if isinstance(cell, InUnit))
            unit = units.most_common(1)[0][0] if units else found["unit"] or ""
            made.append(Column(found["name"], unit, tuple(cells)))
        return cls(title, tuple(made), **more)

    def only(self, *names: str) -> Listing:
        """These columns alone, in this order; one that is not there is left out.

        Args:
            *names: of the columns, without their units.
        """
        found = {column.name: column for column in self.columns}
        return replace(self, columns=tuple(found[name] for name in names if name in found))

    @property
    def heads(self) -> list[str]:
        """Name and unit of each column."""
        return [column.head for column in self.columns]

    def rows(self, tell: Callable[[Any], str]) -> list[tuple[str, ...]]:
        """The rows as text.

        Args:
            tell: writes a number, None or a sequence.
        """
        return list(zip(*(column.told(tell) for column in self.columns), strict=True))


def _cell(record: Any, key: Key) -> Any:
    if callable(key):
        return key(record)
    return record[key] if isinstance(record, Mapping) else getattr(record, key)


def plainly(value: Any, number: Callable[[Any], str] = spoken.number) -> str:
    """A cell as a terminal shows it: counts whole, other numbers to three digits.

    Args:
        value: a number, a flag, a sequence of numbers, text; None is a dash.
        number: writes what is no count.
    """
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, (int, str)):
        return str(value)
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return ", ".join(plainly(part, number) for part in value)
    return number(value)
