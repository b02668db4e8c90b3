"""What a reader of a foreign file hands over: one plain table of named series, as they stand there.

Every format ends here: `columns_of` makes columns of whatever a file holds, and `RawFile.of` says
which are series, which are text, which are single numbers, and what is left out.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pandas

from picchio.core.arrays import BoolArray, FloatArray
from picchio.core.dates import MISSING, NS
from picchio.core.errors import InputError
from picchio.core.tables import Column, Left, Table, gathered, typed

_DEEPEST = 6
_EXACT = 2**53
_SECONDS = re.compile(r"(.*[._ /])?(s|secs?|seconds)", re.I)
_REST = re.compile(r"(.*[._ /])?(?P<unit>nano|micro|n|u)_?(s|secs?|seconds)", re.I)


@dataclass(frozen=True, eq=False)
class RawChannel:
    """One series of a foreign file.

    Attributes:
        name: unique in its file.
        values: (m,) float64, as stored (int64 where a float would lose digits); NaN where a
            table's cell is empty, `MISSING` where one of dates is.
        time: (m,) s from the file's beginning, where the format itself says; else None.
        unit: as the file says, or None.
        suggestion: the contract's channel it seems to be, or None.
        note: for people.
        clock: whether it is of dates or times by its type, whatever its name.
    """

    name: str
    values: FloatArray
    time: FloatArray | None = None
    unit: str | None = None
    suggestion: str | None = None
    note: str = ""
    clock: bool = False


@dataclass(frozen=True, eq=False)
class RawFile:
    """A foreign file.

    Attributes:
        path: the file.
        kind: one of `picchio.campaign.importing.mapping.KINDS`.
        channels: by name.
        taken: when it was recorded, where the format says.
        epoch: ns from 1970 to zero of the channels' times, where the file says.
        detected: what was found out about the file, a sentence each.
        before: samples of a table that stand in the blocks before this one.
        texts: (m,) of each column of text.
        scalars: single numbers, such as a sampling rate.
        left: what is left out.
        clock: the series that was its clock, where it has been given to those it tells apart.
    """

    path: Path
    kind: str
    channels: dict[str, RawChannel]
    taken: datetime | None = None
    epoch: int | None = None
    detected: tuple[str, ...] = ()
    before: int = 0
    texts: dict[str, Any] = field(default_factory=dict)
    scalars: dict[str, float] = field(default_factory=dict)
    left: tuple[Left, ...] = ()
    clock: str | None = None

    @classmethod
    def of(cls, path: Path, kind: str, columns: Iterable[Column | Left],
           detected: tuple[str, ...] = ()) -> RawFile:  # fmt: skip
        """A file of such columns.

        Args:
            path: the file.
            kind: of it.
            columns: of numbers, dates, text, or single numbers ("scalar"); what is left out.
            detected: a sentence each.

        Raises:
            InputError: it holds no series.
        """
        channels: dict[str, RawChannel] = {}
        texts, scalars, kinds, lost = {}, {}, {}, []
        for c in columns:
            if isinstance(c, Left):
                lost.append(c)
            elif c.kind == "text":
                texts[c.name] = c.values
            elif c.kind == "scalar":
                scalars[c.name] = float(c.values)
            else:
                clock, kinds[c.name] = c.kind in ("date", "clock"), c.kind
                channels[c.name] = RawChannel(
                    c.name, c.values, unit=c.unit, note=c.note, clock=clock
                )
        made = cls(path, kind, _paired(channels, kinds), None, None, detected, 0, texts, scalars,
                   tuple(lost))  # fmt: skip
        if not channels:
            raise InputError("holds no series of numbers", file=path,
                             hint="; ".join(made.told[:3]) or None)  # fmt: skip
        return made

    @classmethod
    def of_table(cls, table: Table) -> RawFile:
        """A table of text.

        Args:
            table: or a block of it.
        """
        notes = (f"{c.name}: {c.note}" for c in table.columns.values() if c.note)
        told = (table.layout.told, *table.told, *notes)
        return cls.of(table.path, "csv", [*table.columns.values(), *table.left], told)

    @property
    def rows(self) -> int:
        """Of a table; 0 where its series differ in length."""
        sizes = {len(c.values) for c in self.channels.values()} | set(map(len, self.texts.values()))
        return sizes.pop() if len(sizes) == 1 else 0

    @property
    def told(self) -> tuple[str, ...]:
        """What was found out and what is left out, a sentence each."""
        texts = tuple(
            Left("text", len(cells), 1, str(cells[0]), len(cells), name, "row").told
            for name, cells in self.texts.items()
        )
        single = ", ".join(f"{name} = {value:.6g}" for name, value in self.scalars.items())
        return (*self.detected, *((f"single numbers: {single}",) if single else ()),
                *(one.told for one in self.left), *texts)  # fmt: skip

    def channel(self, name: str, *, mapping: Path | None = None, key: str = "from") -> RawChannel:
        """A series by name.

        Raises:
            InputError: the file has no such series, or it is text.
        """
        if name in self.texts:
            cell = str(self.texts[name][0])
            raise InputError(f"{self.path.name} holds text in it, not numbers", file=mapping,
                             key=f"{key} = {name!r}, row 1", value=cell)  # fmt: skip
        if name not in self.channels:
            raise InputError(f"{self.path.name} has no such series", file=mapping, key=key,
                             value=name, choices=self.channels)  # fmt: skip
        return self.channels[name]

    def at(self, rows: Any) -> RawFile:
        """The same with some of a table's rows.

        Args:
            rows: (m,) whether each is there; series of another length stay as they are.
        """
        channels = {
            n: replace(c, values=c.values[rows]) if c.time is None and len(c.values) == len(rows)
            else c for n, c in self.channels.items()
        }  # fmt: skip
        texts = {n: x[rows] if len(x) == len(rows) else x for n, x in self.texts.items()}
        return replace(self, channels=channels, texts=texts)


def below(parts: list[RawFile]) -> RawFile:
    """Blocks of a table as one; a series that some of them lack is left out, and told.

    Args:
        parts: in their order.

    Returns:
        the table.
    """
    first = parts[0]
    if len(parts) == 1:
        return first
    found: dict[tuple[str, bool], list[Any]] = {}
    for part in parts:
        for name, channel in part.channels.items():
            found.setdefault((name, False), []).append(channel.values)
        for name, cells in part.texts.items():
            found.setdefault((name, True), []).append(cells)
    whole = {key: np.concatenate(v) for key, v in found.items() if len(v) == len(parts)}
    channels = {n: replace(c, values=whole[n, False]) for n, c in first.channels.items()
                if (n, False) in whole}  # fmt: skip
    texts = {name: whole[name, True] for name in first.texts if (name, True) in whole}
    lost = [
        Left("not in all parts of the file", sum(map(_count, v)), 1, str(v[0][0]), len(v), key[0],
             "row") for key, v in found.items() if key not in whole
    ]  # fmt: skip
    left = gathered([*(one for part in parts for one in part.left), *lost])
    return replace(first, channels=channels, texts=texts, left=left)


def columns_of(
    name: str,
    value: Any,
    depth: int = _DEEPEST,
    *,
    table: bool = False,
    kinds: dict[str, str] | None = None,
) -> Iterator[Column | Left]:
    """What a value of a MATLAB, NumPy, Parquet or JSON file holds, as columns.

    A field of a struct is `name.field`; of a matrix, or of a column of lists, `name(1)`, `name(2)`,
    ... along its shorter side. Dates are ns from 1970, True is 1. A single number is a "scalar".
    Objects of Python are what most of them are, as the cells of a table of text. Whatever becomes
    no value of a column is told.

    Args:
        name: of the value; empty for a whole file.
        value: array, list, table, or dictionary of them.
        depth: how many structs may stand in one another.
        table: whether it is a table, of which one row is a series, too.
        kinds: what columns of objects hold, as the blocks before told; added to.

    Returns:
        the columns, and what is none of them.
    """
    kinds = {} if kinds is None else kinds
    if hasattr(value, "to_dict") and hasattr(value, "columns"):  # a table of pandas
        index = value.index
        named = {} if index.dtype.kind not in "mM" else {index.name or "index": index.to_numpy()}
        value, table = named | {str(key): value[key].to_numpy() for key in value.columns}, True
    array: Any = np.empty(0) if isinstance(value, dict) else _array(value)
    cells = [_single(cell) for cell in array.ravel().tolist()] if array.dtype.kind == "O" else []
    if array.dtype.names:
        record: Any = array.ravel()[0] if array.size == 1 else array
        value = {key: record[key] for key in array.dtype.names}
    elif cells and all(isinstance(cell, dict) for cell in cells):
        keys = dict.fromkeys(key for cell in cells for key in cell)
        value = {key: [cell.get(key) for cell in cells] for key in keys}
    if isinstance(value, dict):
        for key, part in value.items():
            own = f"{name}.{key}" if name else str(key)
            if depth:
                yield from columns_of(own, part, depth - 1, table=table, kinds=kinds)
            else:
                yield Left(f"more than {_DEEPEST} levels deep", 1, 1, "", 1, own, "row")
        return
    if any(isinstance(cell, (list, tuple, np.ndarray)) for cell in cells):
        lists: list[Any] = [np.ravel(cell) for cell in cells if cell is not None]
        width = lists[0].size
        if any(one.size != width or one.dtype.kind not in "iufb" for one in lists):
            why, count = "lists of several lengths, or of no numbers", sum(map(len, lists))
            yield Left(why, count, 1, str(cells[0])[:60], len(cells), name, "row")
            return
        nothing = np.full(width, np.nan)
        array = np.array([nothing if c is None else np.ravel(c) for c in cells], dtype=np.float64)
    vector = array.size == max(array.shape, default=1) and (array.size > 1 or table)
    if vector and array.dtype.kind in "OUS":
        cells = cells or [str(cell) for cell in array.astype(str).ravel()]
        yield from _of_cells(name, cells, kinds)
        return
    with contextlib.suppress(TypeError, ValueError, OverflowError):
        array = np.array(cells, dtype=np.float64).reshape(array.shape) if cells else array
    kind = array.dtype.kind
    if kind in "OUScV" or array.ndim > 2:
        what = {"c": "complex numbers", "V": "bytes"}.get(kind, "no numbers")
        what = f"an array of {array.ndim} dimensions" if array.ndim > 2 else what
        text = str(array.ravel()[0])[:60] if array.size else ""
        yield Left(what, array.size, 1, text, 1, name, "row")
        return
    if array.size == 1 and kind not in "mM" and not table:
        yield Column(name, "scalar", array.ravel()[0])
        return
    if array.size == 0:
        return
    dated = {"M": "date", "m": "clock"}.get(kind, "number")
    if kind in "mM":
        array = array.astype(f"{kind}8[ns]").astype(np.int64)
    # A recording has more samples than channels.
    upright = array.ndim == 2 and (table or array.shape[0] > array.shape[1])
    rows = np.atleast_2d(array.T if upright else array)
    for i, row in enumerate(rows, start=1):
        own = name if array.ndim < 2 or len(rows) == 1 else f"{name}({i})"
        exact = dated != "number" or (
            row.dtype.kind in "iu" and _EXACT <= int(row.max()) <= np.iinfo(np.int64).max
        )
        values = row.astype(np.int64 if exact else np.float64)
        yield from _told(Column(own, dated, values, "ns" if dated != "number" else None))


def _single(cell: Any) -> Any:
    """What stands in a cell of a cell array: a single number or text, an array, or nothing."""
    while isinstance(cell, np.ndarray) and cell.size == 1 and not cell.dtype.names:
        cell = cell.item()
    return None if isinstance(cell, (list, tuple, np.ndarray)) and not np.size(cell) else cell


def _array(value: Any) -> Any:
    """A value as an array; lists of several lengths as one of objects."""
    try:
        return np.asarray(value)
    except ValueError:
        array: Any = np.empty(len(value), dtype=object)
        array[:] = value
        return array


def _of_cells(name: str, cells: list[Any], kinds: dict[str, str]) -> Iterator[Column | Left]:
    """A column of single objects of Python: numbers, or what their text says."""
    found, texts = None, None
    if kinds.get(name, "number") == "number" and not any(isinstance(c, str) for c in cells):
        with contextlib.suppress(TypeError, ValueError, OverflowError):
            found = Column(name, "number", np.array(cells, dtype=np.float64))
    if found is None:
        empty = pandas.isna(np.array(cells, dtype=object))
        texts = ["" if none else _text(cell) for cell, none in zip(cells, empty, strict=True)]
        found = typed(name, texts, kind=kinds.get(name))
    if texts is None or any(texts):
        kinds[name] = found.kind
    yield from _told(found, texts)


def _text(cell: Any) -> str:
    return (cell.decode(errors="replace") if isinstance(cell, bytes) else str(cell)).strip()


def _gone(values: Any) -> BoolArray:
    """(m,) whether a value is missing; none is of text."""
    if values.dtype.kind == "f":
        return np.asarray(~np.isfinite(values))
    return (
        np.asarray(values == MISSING) if values.dtype.kind == "i" else np.zeros(len(values), bool)
    )


def _count(values: Any) -> int:
    return int((~_gone(values)).sum())


def _told(column: Column, texts: list[str] | None = None) -> Iterator[Column | Left]:
    """A column with NaN where a value is not finite, and what of it is no number or no date."""
    values, gone = column.values, _gone(column.values)
    if values.dtype.kind == "f" and gone.any():
        column = replace(column, values=np.where(gone, np.nan, values))
    yield column
    for first in np.flatnonzero(gone)[:1]:
        text = texts[first] if texts else "" if column.kind != "number" else str(values[first])
        count = int(gone.sum())
        yield Left("no number", count, int(first) + 1, text, count, column.name, "row")


def _paired(channels: dict[str, RawChannel], kinds: dict[str, str]) -> dict[str, RawChannel]:
    """Two columns that are one clock as one: date and time of day, seconds and nanoseconds."""
    names = list(channels)
    days = [name for name in names if kinds.get(name) == "day"]
    hours = [name for name in names if kinds.get(name) == "clock" and channels[name].clock]
    for name in hours:
        channels[name] = replace(channels[name], values=_unwrapped(channels[name].values))
    if days and hours:
        day, hour = channels[days[0]].values, channels[hours[0]].values
        # Past midnight the date has moved on, too.
        ns = np.where((day == MISSING) | (hour == MISSING), MISSING, day + hour % (86400 * NS))
        return _joined(channels, days[0], hours[0], ns)
    for first, second in zip(names, names[1:], strict=False):
        if (ns_ := _seconds_and(channels[first], channels[second])) is not None:
            return _joined(channels, first, second, ns_)
    return channels


def _joined(
    channels: dict[str, RawChannel], first: str, second: str, ns: FloatArray
) -> dict[str, RawChannel]:
    name = f"{first} + {second}"
    both = RawChannel(name, ns, unit="ns", note="two columns", clock=True)
    return {name: both} | {n: c for n, c in channels.items() if n not in (first, second)}


def _unwrapped(ns: FloatArray) -> FloatArray:
    """Times of day that go on past midnight."""
    back = np.diff(ns, prepend=ns[:1]) < -43200 * NS
    return np.where(ns == MISSING, MISSING, ns + 86400 * NS * np.cumsum(back))


def _seconds_and(first: RawChannel, second: RawChannel) -> FloatArray | None:
    """Ns of seconds and the rest in two columns, by their names, or without names their values."""
    rest = _REST.fullmatch(second.name.strip())
    unnamed = first.name.isdigit() and second.name.isdigit()
    if not (rest and _SECONDS.fullmatch(first.name.strip())) and not unnamed:
        return None
    a, b = first.values, second.values
    factor = {"n": 1, "u": 1000}[rest["unit"][0].lower()] if rest else 1
    if not (np.isfinite(a).all() and np.isfinite(b).all()) or a.size < 2:
        return None
    if (a % 1).any() or (b % 1).any() or b.min() < 0 or b.max() >= NS // factor:
        return None
    ns = a.astype(np.int64) * NS + b.astype(np.int64) * factor
    steps = np.diff(ns)
    # Without names only a date, and no running number beside it: a sample a microsecond at most.
    sure = rest is not None or (a[0] >= 978_307_200 and np.median(steps) >= 1000
                                and steps.min() >= 0 and not (np.diff(a) > 0).all())  # fmt: skip
    return ns if sure else None
