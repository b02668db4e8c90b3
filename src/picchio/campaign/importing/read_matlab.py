"""MATLAB .mat files up to version 7 (scipy reads them).

scipy's reader is compiled and dies with a bus error on some damaged files, so it works in a
process of its own.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path
from subprocess import TimeoutExpired
from typing import Any

import numpy as np

from picchio.campaign.importing.mapping import Mapping
from picchio.campaign.importing.raw import RawChannel, RawFile, reason
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.core.files import regular_file
from picchio.core.processes import run_python

_DEEPEST = 6
_REFUSED = 3
_CHILD = "from picchio.campaign.importing.read_matlab import child; child(*sys.argv[1:])"
# What the reader may take: of a file of 1 GiB some 5 min and 12 GiB, compressed as it may be.
_SECONDS, _SECONDS_A_BYTE = 60.0, 2.5e-7
_MEMORY, _MEMORY_A_BYTE = 4 << 30, 8


def read(path: Path, mapping: Mapping | None) -> RawFile:
    """Every vector, and every row of a matrix, of the variables and their structs' fields.

    A series is named as MATLAB spells it: `t`, `rec.force`, and `rec.position(2)` for the second
    of a matrix's rows (of its columns, where there are fewer columns than rows).

    Raises:
        InputError: no .mat file, one of version 7.3, a damaged one, or one without numbers.
    """
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "series.npz"
        size = regular_file(path).stat().st_size
        seconds, memory = _SECONDS + size * _SECONDS_A_BYTE, _MEMORY + size * _MEMORY_A_BYTE
        try:
            done = run_python(_CHILD, [str(path), str(out)], seconds=seconds, memory=memory)
        except TimeoutExpired:
            raise InputError(f"could not be read within {seconds:.0f} s", file=path) from None
        if done.returncode == _REFUSED:
            raise InputError(file=path, **json.loads(done.stdout))
        if done.returncode != 0:
            raise InputError("is a damaged .mat file: its reader crashed", file=path)
        with np.load(out) as found:
            names = [str(name) for name in found["names"]]
            channels = {n: RawChannel(n, found[f"series_{i}"]) for i, n in enumerate(names)}
    return RawFile(path, "matlab", channels)


def child(path: str, out: str) -> None:
    """Read the file and leave its series as .npz; the other process runs this."""
    try:
        series = _load(Path(path))
    except InputError as error:
        print(json.dumps({"problem": error.problem, "hint": error.hint}))
        sys.exit(_REFUSED)
    arrays = {f"series_{i}": values for i, values in enumerate(series.values())}
    np.savez(out, allow_pickle=False, names=np.array(list(series)), **arrays)


def _load(path: Path) -> dict[str, FloatArray]:
    from scipy.io import loadmat

    try:
        content = loadmat(path, squeeze_me=True, struct_as_record=False)
    except NotImplementedError:
        raise InputError("is a version 7.3 file (HDF5), which is not read",
                         hint="save it in MATLAB with '-v7'") from None  # fmt: skip
    except MemoryError:
        raise InputError("needs more memory than its size allows for") from None
    except Exception as error:  # a damaged file may raise anything
        raise InputError(f"is not a readable .mat file: {reason(error)}") from None
    series: dict[str, FloatArray] = {}
    for name, value in content.items():
        if not name.startswith("__"):
            _collect(name, value, series, _DEEPEST)
    if not series:
        raise InputError("holds no series of numbers")
    return series


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
