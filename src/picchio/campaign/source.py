"""Where a record's samples come from: one interface for CSV, Parquet and arrays in memory."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from picchio.campaign.channels import TIME, Channel, ChannelKind, parse_header
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.core.files import regular_file
from picchio.core.units import Conversion

Samples = dict[str, FloatArray]
Block = tuple[int, Samples]
Arrays = Mapping[str, FloatArray] | Callable[[], Mapping[str, FloatArray]]


@contextmanager
def library(
    kind: str, needs: str, path: Path, key: str | None = None, *, extra: str = "import"
) -> Iterator[None]:
    """Whatever a library raises of a file, or that it is not there, becomes one line.

    Args:
        kind: of file, such as "Parquet file".
        needs: the libraries that read it.
        path: the file.
        key: the record's name in messages.
        extra: which of picchio's extras brings the libraries.

    Returns:
        a context manager.

    Raises:
        InputError: a library is missing, or the file is none of its kind, or damaged.
    """
    try:
        yield
    except (MemoryError, InputError):
        raise
    except ImportError:
        raise InputError(f"{kind}s need {needs}", file=path, key=key,
                         hint=f"pip install 'picchio[{extra}]'") from None  # fmt: skip
    except Exception as error:  # the libraries' own kinds, and whatever damage makes
        said = str(error).partition("\n")[0] or type(error).__name__
        raise InputError(f"is not a readable {kind}: {said}", file=path, key=key) from None


@dataclass(frozen=True)
class Column:
    """One column of a file: its place, its channel, and how its values become SI."""

    index: int
    channel: Channel
    convert: Conversion


@dataclass(frozen=True)
class Layout:
    """What the columns of a file may be.

    Attributes:
        first: the column that comes first and ascends; None where rows have no order.
        kinds: of the columns; those of a record in time where empty.
    """

    first: str | None = TIME
    kinds: tuple[ChannelKind, ...] = ()


class Source(ABC):
    """The samples of one record.

    Attributes:
        layout: what its columns may be.
        key: the record's name in messages, such as "record[2]".
        path: its file; None in memory.
        channels: by name, without the time, in the file's order.
        row_word: what messages call a sample: "line", "row" or "sample".
        time_scale: s, the unit that the time is stored in.
    """

    layout: Layout = Layout()
    key: str
    path: Path | None
    channels: Mapping[str, Channel]
    row_word: str = "sample"
    first_row: int = 1
    time_scale: float = 1.0

    @abstractmethod
    def blocks(self, names: Sequence[str], size: int) -> Iterator[Block]:
        """Blocks of about `size` samples in the record's order: first index, {name: (m,) SI}.

        `names` may hold "time" and any of `channels`; every value given is finite.

        Args:
            names: channels wanted.
            size: samples a block, about.

        Returns:
            pairs of first index and {name: (m,) SI}.
        """

    def error(self, problem: str, *, channel: str | None = None, sample: int | None = None,
              **more: object) -> InputError:  # fmt: skip
        """An InputError that names file, record, channel and line.

        Args:
            problem: what is wrong, in words.
            channel: where it is wrong.
            sample: its index, from 0.
            more: as InputError takes it.
        """
        parts = [self.key]
        if channel is not None:
            parts.append(f"channel {channel}")
        if sample is not None:
            parts.append(f"{self.row_word} {sample + self.first_row}")
        return InputError(problem, file=self.path, key=", ".join(parts), **more)  # type: ignore[arg-type]

    def require_finite(self, name: str, values: FloatArray, first: int) -> None:
        """Raise for the first NaN or infinity of a column.

        Args:
            name: the channel.
            values: (m,) of it.
            first: index of the first of them in the record.

        Raises:
            InputError: a value is not finite; names file, line and value.
        """
        if not np.isfinite(values).all():
            bad = int(np.flatnonzero(~np.isfinite(values))[0])
            raise self.error("is not a finite number", channel=name, sample=first + bad,
                             value=float(values[bad]))  # fmt: skip


class FileSource(Source):
    """The samples in a file whose columns are named `channel [unit]`.

    Args:
        path: the file; its columns' names are read at once, its samples when needed.
        key: the record's name in messages.
        layout: what its columns may be.

    Attributes:
        columns: by channel name, the first of them first.

    Raises:
        InputError: missing, empty, not of this kind, or the names are wrong.
    """

    def __init__(self, path: Path, key: str = "record", layout: Layout | None = None) -> None:
        self.path: Path = path
        self.key = key
        self.layout = layout or Layout()
        self.columns = _columns(self, self.names())
        first = self.layout.first
        if first is not None:
            self.time_scale = self.columns[first].convert.scale
        self.channels = {name: c.channel for name, c in self.columns.items() if name != first}

    def checked_path(self) -> Path:
        """The file, once it is sure that it is there and no pipe.

        Raises:
            InputError: missing, a folder, a pipe or a device.
        """
        try:
            return regular_file(self.path)
        except InputError as error:
            raise error.placed(key=self.key) from None

    @abstractmethod
    def names(self) -> list[str]:
        """The columns' names."""


def _columns(source: Source, cells: Sequence[str]) -> dict[str, Column]:
    """The columns of a file by channel name, the time first.

    Raises:
        InputError: a bad header, an unknown channel, a wrong unit, a duplicate, the
            time missing or not first, or nothing beside it.
    """
    columns: dict[str, Column] = {}
    for index, cell in enumerate(cells):
        try:
            channel, convert = parse_header(cell, source.layout.kinds)
        except InputError as error:
            where = f"{source.key}, column {index + 1}" + (f", {error.key}" if error.key else "")
            raise error.placed(file=source.path, key=where) from None
        if channel.name in columns:
            raise source.error(
                f"columns {columns[channel.name].index + 1} and {index + 1} are the same channel",
                channel=channel.name,
            )
        columns[channel.name] = Column(index, channel, convert)
    first = source.layout.first
    if first is None:
        return columns
    if next(iter(columns), None) != first:
        found = cells[0].strip() if cells else ""
        unit = "s" if first == TIME else "Hz"
        raise source.error(f"the first column must be '{first} [{unit}]'", value=found)
    if len(columns) == 1:
        raise source.error("holds no channel beside the time")
    return columns


class MemorySource(Source):
    """Arrays in memory, or a function that makes them when first needed.

    Args:
        channels: those of the record, without the time.
        arrays: {name: (m,) SI}, the time among them; or a function that returns it.
        key: the record's name in messages.
        layout: what its columns may be.
        path: the file that they are of, if there is one.

    Raises:
        InputError: arrays of several lengths, a channel without array, fewer than two samples.
    """

    def __init__(
        self,
        channels: Sequence[Channel],
        arrays: Arrays,
        key: str = "record",
        layout: Layout | None = None,
        path: Path | None = None,
    ) -> None:
        self.path, self.key = path, key
        self.layout = layout or Layout()
        self.channels = {channel.name: channel for channel in channels}
        self._arrays: dict[str, FloatArray] | None = None
        self._make = arrays if callable(arrays) else lambda: arrays
        if not callable(arrays):
            self.arrays()

    def arrays(self) -> dict[str, FloatArray]:
        """All arrays, the time first, read-only."""
        if self._arrays is None:
            made = self._make()
            found: dict[str, FloatArray] = {}
            first = (self.layout.first,) if self.layout.first is not None else ()
            shape: tuple[int, ...] | None = None
            for name in (*first, *self.channels):
                if name not in made:
                    raise self.error("has no array", channel=name)
                values = np.array(made[name], dtype=np.float64)
                if values.ndim != 1:
                    raise self.error("must be a one-dimensional array", channel=name,
                                     value=values.shape)  # fmt: skip
                shape = values.shape if shape is None else shape
                if values.shape != shape:
                    other = "the time" if first else "the first column"
                    raise self.error(f"must have as many samples as {other} ({shape[0]})",
                                     channel=name, value=values.size)  # fmt: skip
                self.require_finite(name, values, 0)
                values.flags.writeable = False
                found[name] = values
            self._arrays = found
        return self._arrays

    def blocks(self, names: Sequence[str], size: int) -> Iterator[Block]:
        """Views of the arrays."""
        arrays = self.arrays()
        for first in range(0, next(iter(arrays.values())).size, size):
            yield first, {name: arrays[name][first : first + size] for name in names}
