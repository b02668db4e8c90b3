"""Parquet tables of any columns (needs pyarrow), whole or in blocks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from picchio.campaign.importing.isolated import Limits
from picchio.campaign.importing.raw import RawChannel, RawFile, reason
from picchio.core.errors import InputError

LIMITS = Limits(memory_a_byte=64.0)
_BUFFER = 1 << 20  # bytes


def read(path: Path, clock: Mapping[str, Any]) -> RawFile:
    """Every column of numbers or dates; dates become ns from 1970, an empty cell NaN.

    Args:
        path: the file.
        clock: the mapping's `[time]`.

    Raises:
        InputError: pyarrow is missing, the file is no Parquet, or holds no such column.
    """
    parts = list(blocks(path, None, 1 << 20))
    if not parts:
        raise InputError("is empty", file=path)
    channels = {
        name: RawChannel(
            name, np.concatenate([part.channels[name].values for part in parts]), unit=channel.unit
        )
        for name, channel in parts[0].channels.items()
    }
    return RawFile(path, "parquet", channels)


def blocks(path: Path, names: set[str] | None, size: int) -> Iterator[RawFile]:
    """The same in blocks of rows: memory does not grow with the file.

    Args:
        path: the file.
        names: of the columns that are needed; all where None.
        size: rows.

    Raises:
        InputError: as `read`.
    """
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise InputError("Parquet files need pyarrow", hint="pip install 'picchio[parquet]'") from (
            None
        )
    types = pyarrow.types
    try:
        # Nothing is read ahead: a column of a large row group would be held whole.
        with pyarrow.parquet.ParquetFile(path, pre_buffer=False, buffer_size=_BUFFER) as file:
            schema = file.schema_arrow
            dates = {f.name for f in schema if types.is_timestamp(f.type)}
            numbers = {
                f.name for f in schema if types.is_floating(f.type) or types.is_integer(f.type)
                or types.is_boolean(f.type)
            }  # fmt: skip
            columns = [n for n in schema.names if n in dates | numbers]
            if names is not None:
                columns = [n for n in columns if n in names]
            if not columns:
                raise InputError("holds no column of numbers", file=path)
            for group in range(file.num_row_groups):
                for batch in file.iter_batches(size, row_groups=[group], columns=columns):
                    channels = {}
                    for name in columns:
                        cells = batch.column(name)
                        if name in dates:
                            cells = cells.cast(pyarrow.timestamp("ns")).cast(pyarrow.int64())
                        if cells.null_count:
                            cells = cells.cast(pyarrow.float64())
                        values = cells.to_numpy(zero_copy_only=False)
                        if values.dtype.kind == "b" or values.dtype == np.float32:
                            values = values.astype(np.float64)
                        if values.dtype.kind in "iu" and not (
                            values.size and abs(int(values[0])) >= 2**53
                        ):
                            values = values.astype(np.float64)
                        channels[name] = RawChannel(
                            name, values, unit="ns" if name in dates else None
                        )
                    yield RawFile(path, "parquet", channels)
    except (pyarrow.ArrowException, OSError, ValueError) as error:
        raise InputError(f"is not a readable Parquet file: {reason(error)}", file=path) from None
