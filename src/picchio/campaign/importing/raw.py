"""What a reader of a foreign file hands over: one plain table of named series, as they stand there.

Every format ends here: `columns_of` makes columns of whatever a file holds, and `RawFile.of` says
which are series, which are text, which are single numbers, and what is left out.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from picchio.core.arrays import FloatArray
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
        """Samples of the first series: a table's rows."""
        return next((c.values.size for c in self.channels.values()), 0)

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
            rows: (m,) whether each is there, or which.
        """
        channels = {
            n: c if c.time is not None else replace(c, values=c.values[rows])
            for n, c in self.channels.items()
        }
        texts = {name: cells[rows] for name, cells in self.texts.items()}
        return replace(self, channels=channels, texts=texts)


def below(parts: list[RawFile]) -> RawFile:
    """Blocks of a table as one.

    Args:
        parts: in their order.

    Returns:
        the table.
    """
    first = parts[0]
    if len(parts) == 1:
        return first
    channels = {
        n: replace(c, values=np.concatenate([p.channels[n].values for p in parts]))
        for n, c in first.channels.items() if all(n in p.channels for p in parts)
    }  # fmt: skip
    texts = {
        n: np.concatenate([p.texts[n] for p in parts])
        for n in first.texts if all(n in p.texts for p in parts)
    }  # fmt: skip
    left = gathered(one for part in parts for one in part.left)
    return replace(first, channels=channels, texts=texts, left=left)


def columns_of(
    name: str, value: Any, depth: int = _DEEPEST, *, table: bool = False
) -> Iterator[Column | Left]:
    """What a value of a MATLAB, NumPy, Parquet or JSON file holds, as columns.

    A field of a struct is `name.field`; of a matrix, or of a column of lists, `name(1)`, `name(2)`,
    ... along its shorter side. Dates are ns from 1970, True is 1. A single number is a "scalar".

    Args:
        name: of the value; empty for a whole file.
        value: array, list, table, or dictionary of them.
        depth: how many structs may stand in one another.
        table: whether it is a table, of which one row is a series, too.

    Returns:
        the columns, and what is none of them.
    """
    if hasattr(value, "to_dict") and hasattr(value, "columns"):  # a table of pandas
        index = value.index
        named = {} if index.dtype.kind not in "mM" else {index.name or "index": index.to_numpy()}
        value, table = named | {str(key): value[key].to_numpy() for key in value.columns}, True
    if isinstance(value, dict) or hasattr(value, "_fieldnames"):
        parts = value if isinstance(value, dict) else vars(value)
        for key, part in parts.items() if depth else ():
            yield from columns_of(
                f"{name}.{key}" if name else str(key), part, depth - 1, table=table
            )
        return
    try:
        array = np.asarray(value)
    except ValueError:  # lists of several lengths
        array = np.empty(0)
    if array.dtype.names and array.size == 1:
        record = array.ravel()[0]
        yield from columns_of(name, {n: record[n] for n in array.dtype.names}, depth, table=table)
        return
    if array.dtype.names:
        yield from columns_of(name, {n: array[n] for n in array.dtype.names}, depth, table=table)
        return
    if array.dtype.kind == "O":
        array = _plain(array)
        if isinstance(array, dict):
            yield from columns_of(name, array, depth, table=table)
            return
    kind = array.dtype.kind
    if kind in "US" or array.dtype == object:
        cells = [str(cell).strip() for cell in array.ravel()]
        if array.ndim <= 1 and array.dtype != object and len(cells) > 1:
            yield typed(name, cells)
        else:
            yield Left("no numbers", array.size, 1, cells[0][:60] if cells else "", 1, name, "row")
        return
    if kind in "cV" or array.ndim > 2:
        what = "complex numbers" if kind == "c" else f"an array of {array.ndim} dimensions"
        yield Left(what, array.size, 1, str(array.ravel()[:1])[1:-1], 1, name, "row")
        return
    dated = {"M": "date", "m": "clock"}.get(kind, "number")
    if kind in "mM":
        array = array.astype(f"{kind}8[ns]").astype(np.int64)
    if array.size == 1 and dated == "number" and not table:
        yield Column(name, "scalar", array.ravel()[0])
        return
    if array.size == 0:
        return
    # A recording has more samples than channels.
    rows = np.atleast_2d(array if array.ndim == 1 or array.shape[0] <= array.shape[1] else array.T)
    for i, row in enumerate(rows, start=1):
        own = name if array.ndim < 2 or len(rows) == 1 else f"{name}({i})"
        exact = dated != "number" or (row.dtype.kind in "iu" and abs(int(row[0])) >= _EXACT)
        yield Column(own, dated, row.astype(np.int64 if exact else np.float64),
                     "ns" if dated != "number" else None)  # fmt: skip


def _plain(array: Any) -> Any:
    """An array of Python's objects as numbers, text or, of dictionaries, as arrays by key."""
    cells = array.ravel().tolist()
    if cells and all(isinstance(cell, dict) for cell in cells):
        keys = dict.fromkeys(key for cell in cells for key in cell)
        return {key: np.array([cell.get(key) for cell in cells], dtype=object) for key in keys}
    if cells and all(isinstance(cell, str) or cell is None for cell in cells):
        return np.array([cell or "" for cell in cells])
    try:
        return np.array(cells, dtype=np.float64).reshape(*array.shape, -1).squeeze(axis=-1)
    except (ValueError, TypeError):
        pass
    try:
        return np.array([np.ravel(cell) for cell in cells], dtype=np.float64)
    except (ValueError, TypeError):
        return array


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


def reason(error: Exception) -> str:
    """What a reader's library says is wrong, in one line.

    Args:
        error: as it raised.
    """
    return str(error).partition("\n")[0] or type(error).__name__
