"""Universal files, data set 58: their functions, and frequency response functions as records."""

from __future__ import annotations

import contextlib
import io
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from picchio.campaign.channels import FREQUENCY, parse_channel
from picchio.campaign.source import Layout, MemorySource
from picchio.campaign.tables import RecordTable
from picchio.campaign.units import conversion
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError, warn_user

_DIRECTIONS = {0: "", 1: "+X", 2: "+Y", 3: "+Z", 4: "+RX", 5: "+RY", 6: "+RZ",
               -1: "-X", -2: "-Y", -3: "-Z", -4: "-RX", -5: "-RY", -6: "-RZ"}  # fmt: skip
_FRF, _COHERENCE = 4, 6  # function types of data set 58
# What a quantity's numerator is: specific data type of the ordinate, SI unit.
_ORDINATE = {"accelerance": (12, "m/s^2"), "mobility": (11, "m/s"), "receptance": (8, "m")}


def data_sets(path: Path) -> list[dict[str, Any]]:
    """Every data set of a universal file, as pyuff has it.

    Args:
        path: the file.

    Raises:
        InputError: pyuff is missing, or the file is no universal file.
    """
    try:
        import pyuff
    except ImportError:
        raise InputError("UFF files need pyuff", hint="pip install 'picchio[import]'") from None
    try:
        # pyuff prints as it reads.
        with contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = pyuff.UFF(str(path)).read_sets()
    except MemoryError:
        raise
    except Exception as error:  # pyuff raises bare Exceptions
        said = str(error).partition("\n")[0] or type(error).__name__
        raise InputError(f"is not a readable universal file: {said}", file=path) from None
    return [found] if isinstance(found, dict) else list(found)


def place(data: Mapping[str, Any], of: str) -> str:
    """The node and the direction of a function's response or reference, such as "12+X".

    Args:
        data: the data set.
        of: "rsp" or "ref".
    """
    direction = _DIRECTIONS.get(int(data.get(f"{of}_dir", 0) or 0), "")
    return f"{int(data.get(f'{of}_node', 0) or 0)}{direction}"


class _FrfSource(MemorySource):
    """One function of a universal file, read when it is first needed."""

    def __init__(self, path: Path, key: str, layout: Layout, entry: RecordTable) -> None:
        names = ["real", "imag", "coherence"]
        found = _function(path, key, entry)
        names = [name for name in names if name in found]
        channels = [parse_channel(name, None, layout.kinds)[0] for name in names]
        super().__init__(channels, found, key, layout)
        self.path: Path = path  # type: ignore[assignment]


def frf_source(path: Path, key: str, layout: Layout, entry: RecordTable) -> MemorySource:
    """A frequency response function of a universal file (data set 58, function type 4).

    Its coherence (type 6) is taken where the file has it for the same nodes.

    Args:
        path: the file.
        key: the record's name in messages.
        layout: of such records.
        entry: the record's table: which function, what quantity.

    Raises:
        InputError: no universal file; no such function, or several; another quantity.
    """
    if not path.is_file():
        raise InputError("no such file", file=path, key=key)
    return _FrfSource(path, key, layout, entry)


def _function(path: Path, key: str, entry: RecordTable) -> dict[str, FloatArray]:
    sets = [data for data in data_sets(path) if data.get("type") == 58]
    every = [data for data in sets if int(data.get("func_type", 0)) == _FRF]
    named = {f"{place(data, 'rsp')} by {place(data, 'ref')}": data for data in every}
    chosen = [
        data for data in every
        if entry.response in (None, place(data, "rsp"))
        and entry.reference in (None, place(data, "ref"))
    ]  # fmt: skip
    if len(chosen) != 1:
        what = "no such function" if not chosen else f"{len(chosen)} functions: which?"
        raise InputError(f"holds {what}", file=path, key=f"{key}.response, {key}.reference",
                         choices=named or None,
                         hint=None if named else "it holds no function of type 4")  # fmt: skip
    (data,) = chosen
    quantity = entry.quantity or "accelerance"
    kind, unit = _ORDINATE[quantity]
    stated = int(data.get("ordinate_spec_data_type", 0) or 0)
    if stated in {one for one, _ in _ORDINATE.values()} - {kind}:
        is_one = next(name for name, (one, _) in _ORDINATE.items() if one == stated)
        raise InputError("is another quantity", file=path, key=f"{key}.quantity", value=quantity,
                         choices=[is_one])  # fmt: skip
    scale = _scale(data, "ordinate", unit, path) / _scale(data, "orddenom", "N", path)
    values = np.asarray(data["data"], dtype=complex) * scale
    found = {
        FREQUENCY: np.asarray(data["x"], dtype=float), "real": values.real, "imag": values.imag,
    }  # fmt: skip
    for other in sets:
        same = all(place(other, of) == place(data, of) for of in ("rsp", "ref"))
        if same and int(other.get("func_type", 0)) == _COHERENCE:
            found["coherence"] = np.real(np.asarray(other["data"]))
    return found


def _scale(data: Mapping[str, Any], axis: str, unit: str, path: Path) -> float:
    """What the file's values of one axis are in SI; 1 where it names no unit."""
    label = str(data.get(f"{axis}_axis_units_lab") or "").strip()
    if label.lower() in ("", "none", "unknown"):
        return 1.0
    try:
        return conversion(label, (unit,))[1].scale
    except InputError:
        warn_user(f"{path}: the unit {label!r} is not understood and taken for {unit}")
        return 1.0
