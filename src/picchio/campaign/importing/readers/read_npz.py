"""NumPy archives (.npz): every array of one or two dimensions."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from picchio.campaign.importing.isolated import Limits
from picchio.campaign.importing.raw import RawChannel, RawFile, reason
from picchio.core.errors import InputError

LIMITS = Limits(memory_a_byte=64.0)


def read(path: Path, clock: Mapping[str, Any]) -> RawFile:
    """Every vector; of a matrix, `name(1)`, `name(2)`, ... along its shorter side.

    Dates (datetime64) become ns from 1970. Pickled objects are not read: they could run code.

    Args:
        path: the file.
        clock: the mapping's `[time]`.

    Raises:
        InputError: no archive, or one without numbers.
    """
    channels: dict[str, RawChannel] = {}
    try:
        with np.load(path, allow_pickle=False) as archive:
            for name in archive.files:
                array = archive[name]
                if array.dtype.kind == "M":
                    array = array.astype("datetime64[ns]").astype(np.int64)
                    channels[name] = RawChannel(name, array, unit="ns")
                elif array.dtype.kind in "fiub" and array.ndim in (1, 2) and max(array.shape) > 1:
                    rows = (
                        array if array.ndim == 2 and array.shape[0] <= array.shape[1] else array.T
                    )
                    for i, row in enumerate(np.atleast_2d(rows), start=1):
                        own = f"{name}({i})" if array.ndim == 2 else name
                        keep = row.dtype.kind in "iu" and abs(int(row[0])) >= 2**53
                        values = row.astype(np.int64 if keep else np.float64)
                        channels[own] = RawChannel(own, values)
    except MemoryError:
        raise
    except Exception as error:  # zipfile's and numpy's own kinds
        raise InputError(f"is not a readable .npz file: {reason(error)}", file=path) from None
    if not channels:
        raise InputError("holds no series of numbers", file=path)
    return RawFile(path, "npz", channels)
