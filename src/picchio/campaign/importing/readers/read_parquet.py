"""Parquet tables of any columns (needs pyarrow), whole or in blocks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from picchio.campaign.importing.isolated import Limits
from picchio.campaign.importing.raw import RawFile, below, columns_of
from picchio.campaign.source import library
from picchio.core.errors import InputError

LIMITS = Limits(memory_a_byte=64.0)
_BUFFER = 1 << 20  # bytes


def read(path: Path, clock: Mapping[str, Any]) -> RawFile:
    """Every column; dates become ns from 1970, an empty cell NaN, lists a series for each place.

    Args:
        path: the file.
        clock: the mapping's `[time]`.

    Raises:
        InputError: pyarrow is missing, the file is no Parquet, or holds no column of numbers.
    """
    parts = list(blocks(path, 1 << 20))
    if not parts:
        raise InputError("is empty", file=path)
    return below(parts)


def blocks(path: Path, size: int) -> Iterator[RawFile]:
    """The same in blocks of rows: memory does not grow with the file.

    Args:
        path: the file.
        size: rows.

    Raises:
        InputError: as `read`.
    """
    with library("Parquet file", "pyarrow", path, extra="parquet"):
        import pyarrow
        import pyarrow.parquet

        kinds: dict[str, str] = {}
        # Nothing is read ahead: a column of a large row group would be held whole.
        with pyarrow.parquet.ParquetFile(path, pre_buffer=False, buffer_size=_BUFFER) as file:
            for group in range(file.num_row_groups):
                for batch in file.iter_batches(size, row_groups=[group]):
                    columns = {}
                    for cells, about in zip(batch.columns, batch.schema, strict=True):
                        if pyarrow.types.is_timestamp(about.type):  # without its zone: UTC
                            cells = cells.cast(pyarrow.timestamp("ns"))
                        columns[about.name] = cells.to_pandas().to_numpy()
                    yield RawFile.of(
                        path, "parquet", columns_of("", columns, table=True, kinds=kinds)
                    )
