"""A record in a Parquet file (needs pyarrow: `pip install picchio[parquet]`)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from picchio.campaign.channels import Channel
from picchio.campaign.source import Block, Column, FileSource, Layout, Samples, library
from picchio.core.processes import memory_size


class ParquetSource(FileSource):
    """A Parquet file whose columns are named `channel [unit]`; integers and floats."""

    row_word = "row"

    def __init__(self, path: Path, key: str = "record", layout: Layout | None = None) -> None:
        super().__init__(path, key, layout)
        import pyarrow.types

        for name, column in self.columns.items():
            kind = self._schema.types[column.index]
            if not (pyarrow.types.is_floating(kind) or pyarrow.types.is_integer(kind)):
                raise self.error("must be a column of numbers", channel=name, value=str(kind))

    def names(self) -> list[str]:
        """As `FileSource`."""
        with self._open() as file:
            if file.metadata.num_rows == 0:
                raise self.error("is empty")
            self._schema = file.schema_arrow
        return list(self._schema.names)

    def _open(self) -> Any:
        path = self.checked_path()
        with library("Parquet file", "pyarrow", path, self.key, extra="parquet"):
            import pyarrow.parquet

            return pyarrow.parquet.ParquetFile(path)

    def blocks(self, names: Sequence[str], size: int) -> Iterator[Block]:
        """As `Source`; reads only the columns needed, one row group at a time."""
        wanted = [self.columns[name] for name in names]
        headers = [self._schema.names[column.index] for column in wanted]
        first = 0
        with (
            self._open() as file,
            library("Parquet file", "pyarrow", self.path, self.key, extra="parquet"),
        ):
            # Over all groups at once pyarrow (26) keeps what it has read.
            for group in range(file.num_row_groups):
                self._require_room(file.metadata.row_group(group), headers, first)
                for batch in file.iter_batches(size, row_groups=[group], columns=headers):
                    yield first, self._converted(wanted, batch, first)
                    first += batch.num_rows

    def _require_room(self, group: Any, headers: list[str], first: int) -> None:
        """Refuse a row group that needs more than half of the memory, before it is read."""
        chunks = [group.column(k) for k in range(group.num_columns)]
        needed = sum(c.total_uncompressed_size for c in chunks if c.path_in_schema in headers)
        if needed > memory_size() / 2:
            raise self.error(
                f"its row group needs {needed / 1e9:.3g} GB of memory, this machine has "
                f"{memory_size() / 1e9:.3g} GB",
                sample=first,
                hint="write it with smaller row groups (row_group_size)",
            )

    def _converted(self, columns: list[Column], batch: Any, first: int) -> dict[str, Any]:
        found = {}
        for column in columns:
            name = column.channel.name
            cells = batch.column(self._schema.names[column.index])
            if cells.null_count:
                empty = int(np.flatnonzero(cells.is_null().to_numpy(zero_copy_only=False))[0])
                raise self.error("the value is missing", channel=name, sample=first + empty)
            values = cells.to_numpy(zero_copy_only=False).astype(np.float64)
            self.require_finite(name, values, first)
            found[name] = column.convert(values)
        return found


def write_parquet(path: Path, channels: Sequence[Channel], blocks: Iterable[Samples]) -> None:
    """Write a record in float64, bit for bit."""
    with library("Parquet file", "pyarrow", path, extra="parquet"):
        import pyarrow.parquet
    schema = pyarrow.schema([(channel.header, pyarrow.float64()) for channel in channels])
    with pyarrow.parquet.ParquetWriter(path, schema) as writer:
        for block in blocks:
            arrays = [pyarrow.array(block[channel.name]) for channel in channels]
            writer.write_table(pyarrow.Table.from_arrays(arrays, schema=schema))
