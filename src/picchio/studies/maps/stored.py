"""A map on disk, which may be damaged: opened, and read variable by variable."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from picchio.core.errors import InputError
from picchio.core.extras import need
from picchio.core.files import regular_file

if TYPE_CHECKING:
    import xarray

# A map's numbers are stored as they are, or packed to some part of that.
_MOST_PACKED = 1000


def open_map(path: str | Path) -> xarray.Dataset:
    """Open a map lazily.

    Args:
        path: of the .nc file or the .zarr folder.

    Returns:
        the dataset; `values_of` reads it.

    Raises:
        InputError: no such file, or none that can be read.
    """
    import xarray

    target = Path(path)
    if target.suffix != ".zarr":
        regular_file(target)
    elif not target.exists():
        raise InputError("no such file", file=target)
    else:
        need("zarr", "Zarr stores", "zarr")
    try:
        if target.suffix == ".zarr":
            found = xarray.open_zarr(target, consolidated=False)
        else:
            found = xarray.open_dataset(target, engine="h5netcdf")
    except Exception as error:  # h5py and zarr raise whatever a damaged file makes them
        raise _damaged(error, target) from None
    found.encoding["source"] = str(target)
    return found


def values_of(
    found: xarray.Dataset, name: str, dimensions: int, rows: slice = slice(None)
) -> NDArray[Any]:
    """The values of a map's variable.

    Args:
        found: the map.
        name: of the variable.
        dimensions: how many it has.
        rows: which of them; all if not given.

    Returns:
        an array of numbers; of "joint", the names.

    Raises:
        InputError: the file has no such variable, or is damaged there.
    """
    file = found.encoding.get("source")
    if name not in found.variables or found[name].ndim != dimensions:
        raise InputError("is no map: a variable is missing or of another shape", file=file,
                         key=name)  # fmt: skip
    if file is not None and found[name].nbytes > _MOST_PACKED * _size(Path(file)):
        raise InputError("is a damaged map: a variable is larger than the file can hold", file=file,
                         key=name, value=found[name].shape)  # fmt: skip
    try:
        values = found[name][rows].values
    except MemoryError:
        raise
    except Exception as error:
        raise _damaged(error, file, name) from None
    if name != "joint" and values.dtype.kind not in "fiu":
        raise InputError("is no map: a variable holds no numbers", file=file, key=name)
    return values


def attribute_of(found: xarray.Dataset, name: str, kind: type = str) -> Any:
    """What a map says of itself.

    Args:
        found: the map.
        name: of the attribute.
        kind: what it is: str, int, or list of texts.

    Raises:
        InputError: the file does not say it, or not so.
    """
    value = found.attrs.get(name)
    try:
        if value is None:
            raise ValueError(name)
        return [str(one) for one in np.atleast_1d(value)] if kind is list else kind(value)
    except (TypeError, ValueError, OverflowError):
        raise InputError("is no map: an attribute is missing or of another kind",
                         file=found.encoding.get("source"), key=name) from None  # fmt: skip


def _size(path: Path) -> int:
    files = path.rglob("*") if path.is_dir() else [path]
    return sum(file.stat().st_size for file in files)


def _damaged(error: Exception, file: str | Path | None, name: str | None = None) -> InputError:
    reason = str(error).partition("\n")[0] or type(error).__name__
    return InputError(f"cannot be read as a map: {reason}", file=file, key=name)
