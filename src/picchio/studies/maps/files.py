"""Chunks of a map joined to one netCDF file or Zarr store, one chunk in memory at a time."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Self

import numpy as np

from picchio.core.errors import InputError
from picchio.core.files import swap_in, writing
from picchio.core.unfinished import remove, unfinished
from picchio.studies.maps.chunk import Columns

# Rows written at a time, and of a piece of a Zarr store: a piece is then written once, not again
# and again with every chunk of the map that falls into it.
_ROWS = 65536
# Of a piece of a netCDF file: what it comes in of itself is written in tens of thousands of pieces.
_CHUNK = 4096
# How pieces of a Zarr store are packed: bits of one place beside each other, as numbers of a map
# differ in the last ones only. Zarr's own choice takes several times as long, and more room.
_PACKED: dict[str, Any] = {"cname": "lz4", "clevel": 1, "shuffle": "bitshuffle"}

# Variable: (dimensions, unit, what it is).
VARIABLES: dict[str, tuple[tuple[str, ...], str, str]] = {
    "place": (("point",), "1", "index of the asked point or pose"),
    "position": (("point", "xyz"), "m", "tool point, world"),
    "pose": (("point", "coordinate"), "rad", "joint positions (m for prismatic joints)"),
    "branch": (("point",), "1", "bit k is set where joint k's position is negative"),
    "natural_frequency": (("point", "mode"), "Hz", "undamped natural frequency"),
    "peak_deflection": (
        ("point", "joint"),
        "rad",
        "largest deflection over time (of slides: m)",
    ),
    "peak_torque": (
        ("point", "joint"),
        "N*m",
        "largest torque of the vibration (of slides: N)",
    ),
    "peak_shear_stress": (("point", "joint"), "Pa", "largest shear stress of the vibration"),
    "worst_direction": (("point", "joint", "xyz"), "1", "unit vector of the force"),
    "limiting_joint": (("point",), "1", "index of the joint with the largest stress or torque"),
    "damage_per_rivet": (("point", "joint"), "1", "Miner's sum of a rivet, cycles by rainflow"),
    "damage_direction": (("point", "joint", "xyz"), "1", "unit vector of the force for it"),
    "peak_deflection_quantiles": (
        ("point", "joint", "level"),
        "rad",
        "peak_deflection of drawn robots, where springs are estimates (of slides: m)",
    ),
    "peak_torque_quantiles": (
        ("point", "joint", "level"),
        "N*m",
        "peak_torque of drawn robots, where springs are estimates (of slides: N)",
    ),
}

EXTRA = (
    "damage_per_rivet",
    "damage_direction",
    "peak_deflection_quantiles",
    "peak_torque_quantiles",
)
"""Damage only in maps that were asked for it; quantiles only of robots that are estimated."""


def join_chunks(target: Path, chunks: Iterable[Columns], attributes: dict[str, Any]) -> None:
    """Write all rows to `target` in order, under another name until it is whole.

    Raises:
        InputError: there is no row at all: no point can be reached.
    """
    writer: type[_ZarrWriter | _NetcdfWriter]
    writer = _ZarrWriter if target.suffix == ".zarr" else _NetcdfWriter
    rows = 0
    labelled = ("joint", "coordinate", "level")
    names = {name: attributes[name] for name in labelled if attributes.get(name)}
    names["xyz"] = list("xyz")
    labels = {name: np.array(values, dtype=object) for name, values in names.items()}
    others = {k: v for k, v in attributes.items() if k not in labelled}
    # Chunks may be computed only when they are asked for: their errors are not the disk's.
    with unfinished(lambda: _fresh(target)) as part:
        with ExitStack() as open_things:
            with writing(target):
                out = writer(part, labels, others)
                open_things.enter_context(out)
            for columns in _in_blocks(chunks):
                with writing(target):
                    out.append(columns)
                rows += len(columns["place"])
            with writing(target):
                open_things.close()
        if not rows:
            raise InputError(
                "no point of the map can be reached within the joint limits", key="places"
            )
        with writing(target):
            swap_in(part, target)


def _in_blocks(chunks: Iterable[Columns]) -> Iterator[Columns]:
    """The same rows, `_ROWS` at a time; the last block may be shorter, none is empty."""
    held: list[Columns] = []
    count = 0
    for columns in chunks:
        held.append(columns)
        count += len(columns["place"])
        while count >= _ROWS:
            whole = {name: np.concatenate([part[name] for part in held]) for name in columns}
            yield {name: values[:_ROWS] for name, values in whole.items()}
            held = [{name: values[_ROWS:].copy() for name, values in whole.items()}]
            count -= _ROWS
    if count:
        yield {name: np.concatenate([part[name] for part in held]) for name in held[0]}


def _fresh(target: Path) -> Path:
    """Where the map is written at first; nothing is there."""
    part = target.with_name(f".{target.name}.part")
    remove(part)
    return part


class _NetcdfWriter:
    def __init__(self, path: Path, labels: Columns, attributes: dict[str, Any]) -> None:
        import h5netcdf

        self._labels, self._attributes = labels, attributes
        self._rows = 0
        self._stream = _KeptError(path)
        self._file = h5netcdf.File(self._stream, "w")
        self._ready = False

    def _prepare(self, columns: Columns) -> None:
        import h5py

        file = self._file
        file.dimensions = {"point": None, "mode": columns["natural_frequency"].shape[1]} | {
            name: len(values) for name, values in self._labels.items()
        }
        for name, values in self._labels.items():
            label = file.create_variable(name, (name,), dtype=h5py.string_dtype())
            label[:] = values
        for name, values in columns.items():
            dims, unit, meaning = VARIABLES[name]
            chunks = (min(_CHUNK, len(values)), *values.shape[1:])
            variable = file.create_variable(name, dims, values.dtype, chunks=chunks)
            variable.attrs["units"] = unit
            variable.attrs["long_name"] = meaning
        file.attrs.update(self._attributes)
        self._ready = True

    def append(self, columns: Columns) -> None:
        if not self._ready:
            self._prepare(columns)
        first, self._rows = self._rows, self._rows + len(columns["place"])
        self._file.resize_dimension("point", self._rows)
        for name, values in columns.items():
            self._file.variables[name][first : self._rows] = values
        self._stream.check()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._file.close()
        self._stream.close()
        if kind is None:
            self._stream.check()


class _KeptError(io.FileIO):
    """A file whose errors are kept for us: HDF5 crashes where one reaches it in its close."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, "w+")
        self._error: OSError | None = None

    def write(self, data: Any) -> int:
        count = memoryview(data).nbytes
        if self._error is None:
            try:
                written = 0
                while written < count:
                    written += super().write(memoryview(data).cast("B")[written:]) or 0
            except OSError as error:
                self._error = error
        return count

    def truncate(self, size: int | None = None) -> int:
        try:
            return super().truncate(size)
        except OSError as error:
            self._error = self._error or error
            return size or 0

    def check(self) -> None:
        """Raise what a write met."""
        if self._error is not None:
            raise self._error


class _ZarrWriter:
    """A store that xarray lays out and Zarr fills, a block of rows at a time."""

    def __init__(self, path: Path, labels: Columns, attributes: dict[str, Any]) -> None:
        self._path, self._labels, self._attributes = path, labels, attributes
        self._group: Any = None
        self._rows = 0

    def append(self, columns: Columns) -> None:
        import zarr

        if self._group is None:
            self._prepare(columns)
            self._group = zarr.open_group(self._path, mode="r+")
        first, self._rows = self._rows, self._rows + len(columns["place"])
        for name, values in columns.items():
            self._group[name].resize((self._rows, *values.shape[1:]))
            self._group[name][first:] = values

    def _prepare(self, columns: Columns) -> None:
        """Without any row."""
        import xarray
        from zarr.codecs import BloscCodec

        data, pieces = {}, {}
        codec = BloscCodec(**_PACKED)
        for name, values in columns.items():
            dims, unit, meaning = VARIABLES[name]
            data[name] = (dims, values[:0], {"units": unit, "long_name": meaning})
            pieces[name] = {"chunks": (_ROWS, *values.shape[1:]), "compressors": (codec,)}
        empty = xarray.Dataset(data, coords=self._labels, attrs=self._attributes)
        empty.to_zarr(self._path, mode="w", consolidated=False, encoding=pieces)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None and self._group is not None:
            import zarr

            with warnings.catch_warnings():
                # Zarr 3 has consolidated metadata ahead of its own specification.
                warnings.simplefilter("ignore")
                zarr.consolidate_metadata(str(self._path))
