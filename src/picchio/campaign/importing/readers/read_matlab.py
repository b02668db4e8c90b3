"""MATLAB .mat files up to version 7 (scipy reads them)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from picchio.campaign.importing.isolated import Limits
from picchio.campaign.importing.raw import RawChannel, RawFile, reason
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError

_DEEPEST = 6
LIMITS = Limits(seconds_a_byte=2.5e-7)


def read(path: Path, clock: Mapping[str, Any]) -> RawFile:
    """Every vector, and every row of a matrix, of the variables and their structs' fields.

    A series is named as MATLAB spells it: `t`, `rec.force`, and `rec.position(2)` for the second
    of a matrix's rows (of its columns, where there are fewer columns than rows).

    Raises:
        InputError: no .mat file, one of version 7.3, a damaged one, or one without numbers.
    """
    from scipy.io import loadmat

    try:
        content = loadmat(path, squeeze_me=True, struct_as_record=False)
    except NotImplementedError:
        raise InputError("is a version 7.3 file (HDF5), which is not read", file=path,
                         hint="save it in MATLAB with '-v7'") from None  # fmt: skip
    except MemoryError:
        raise
    except Exception as error:  # a damaged file may raise anything
        problem = f"is not a readable .mat file: {reason(error)}"
        raise InputError(problem, file=path) from None
    series: dict[str, FloatArray] = {}
    for name, value in content.items():
        if not name.startswith("__"):
            _collect(name, value, series, _DEEPEST)
    if not series:
        raise InputError("holds no series of numbers", file=path)
    channels = {name: RawChannel(name, values) for name, values in series.items()}
    return RawFile(path, "matlab", channels)


def _collect(name: str, value: Any, series: dict[str, FloatArray], depth: int) -> None:
    if hasattr(value, "_fieldnames"):
        for field in value._fieldnames if depth else ():
            _collect(f"{name}.{field}", getattr(value, field), series, depth - 1)
        return
    array = np.asarray(value)
    if array.dtype.kind not in "fiub" or array.ndim not in (1, 2) or max(array.shape) < 2:
        return
    if array.ndim == 1:
        series[name] = array.astype(np.float64)
        return
    # A recording has more samples than channels.
    rows = array if array.shape[0] <= array.shape[1] else array.T
    for index, row in enumerate(rows, start=1):
        series[f"{name}({index})"] = row.astype(np.float64)
