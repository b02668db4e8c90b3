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
from picchio.campaign.source import Layout, MemorySource, library
from picchio.campaign.tables import RecordTable
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError, warn_user
from picchio.core.units import conversion

_DIRECTIONS = {0: "", 1: "+X", 2: "+Y", 3: "+Z", 4: "+RX", 5: "+RY", 6: "+RZ",
               -1: "-X", -2: "-Y", -3: "-Z", -4: "-RX", -5: "-RY", -6: "-RZ"}  # fmt: skip
_FRF, _COHERENCE = 4, 6  # function types of data set 58
_NO_UNIT = ("", "none", "unknown")
ORDINATE = {"accelerance": (12, "m/s^2"), "mobility": (11, "m/s"), "receptance": (8, "m")}
"""What a quantity's numerator is: specific data type of the ordinate, SI unit."""


def data_sets(path: Path) -> list[dict[str, Any]]:
    """Every data set of a universal file, as pyuff has it.

    Args:
        path: the file.

    Raises:
        InputError: pyuff is missing, or the file is no universal file.
    """
    # pyuff prints as it reads.
    with (
        library("universal file", "pyuff", path),
        contextlib.redirect_stdout(io.StringIO()),
        warnings.catch_warnings(),
    ):
        import pyuff

        warnings.simplefilter("ignore")
        found = pyuff.UFF(str(path)).read_sets()
    return [found] if isinstance(found, dict) else list(found)


def place(data: Mapping[str, Any], of: str) -> str:
    """The node and the direction of a function's response or reference, such as "12+X".

    Args:
        data: the data set.
        of: "rsp" or "ref".
    """
    direction = _DIRECTIONS.get(int(data.get(f"{of}_dir", 0) or 0), "")
    return f"{int(data.get(f'{of}_node', 0) or 0)}{direction}"


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
    found = _function(path, key, entry)
    names = [name for name in ("real", "imag", "coherence") if name in found]
    channels = [parse_channel(name, None, layout.kinds)[0] for name in names]
    return MemorySource(channels, found, key, layout, path)


def _function(path: Path, key: str, entry: RecordTable) -> dict[str, FloatArray]:
    sets = data_sets(path)
    every = [data for data in sets if _is(data, _FRF)]
    asked = {"response": entry.response, "reference": entry.reference, "function": entry.function}
    told = [
        {"response": {place(data, "rsp")}, "reference": {place(data, "ref")},
         "function": {str(number), *_names(data)}}
        for number, data in enumerate(every, start=1)
    ]  # fmt: skip
    chosen = [
        data for data, one in zip(every, told, strict=True)
        if all(wanted is None or str(wanted) in one[name] for name, wanted in asked.items())
    ]  # fmt: skip
    if len(chosen) != 1:
        what = "no such function" if not chosen else f"{len(chosen)} functions: which?"
        choices = [
            f"{number}: {' '.join(_names(data))} {' by '.join(_places(data))}"
            for number, data in enumerate(every, start=1)
        ]
        raise InputError(f"holds {what}", file=path, key=", ".join(f"{key}.{a}" for a in asked),
                         choices=choices or None,
                         hint="function is the number or the name, response and reference are the "
                         "places" if choices else "it holds no function of type 4")  # fmt: skip
    (data,) = chosen
    quantity = entry.quantity or "accelerance"
    stated = int(data.get("ordinate_spec_data_type", 0) or 0)
    if stated in {one for one, _ in ORDINATE.values()} - {ORDINATE[quantity][0]}:
        is_one = next(name for name, (one, _) in ORDINATE.items() if one == stated)
        raise InputError("is another quantity", file=path, key=f"{key}.quantity", value=quantity,
                         choices=[is_one])  # fmt: skip
    try:
        scale = _scale(data, sets, ORDINATE[quantity][1], path)
    except InputError as error:
        raise error.placed(file=path, key=f"{key} ({quantity})") from None
    values = np.asarray(data["data"], dtype=complex) * scale
    found = {
        FREQUENCY: np.asarray(data["x"], dtype=float), "real": values.real, "imag": values.imag,
    }  # fmt: skip
    alike = [other for other in every if _places(other) == _places(data)]
    same = [other for other in sets if _is(other, _COHERENCE) and _places(other) == _places(data)]
    if len(same) == len(alike):  # several of one place stand in the same order
        at = next(k for k, other in enumerate(alike) if other is data)
        found["coherence"] = np.real(np.asarray(same[at]["data"]))
    elif same:
        warn_user(f"{path.parent}: coherences are left out where several functions are between the "
                  "same places and not as many coherences")  # fmt: skip
    return found


def _is(data: Mapping[str, Any], kind: int) -> bool:
    return data.get("type") == 58 and int(data.get("func_type", 0)) == kind


def _places(data: Mapping[str, Any]) -> tuple[str, str]:
    return place(data, "rsp"), place(data, "ref")


def _names(data: Mapping[str, Any]) -> list[str]:
    """The lines that name a function, such as "H1 : # 2 / # 1"."""
    lines = (str(data.get(f"id{k}") or "").strip() for k in range(1, 6))
    return [line for line in lines if line and line.upper() != "NONE"]


def _scale(
    data: Mapping[str, Any], sets: list[dict[str, Any]], unit: str, path: Path
) -> float:  # fmt: skip
    """What the file's values are in SI, by the labels of its axes, or else its data set 164."""
    over, under = (label_of(data, axis) for axis in ("ordinate", "orddenom"))
    system = next((one for one in sets if one.get("type") == 164), {})
    if not system and not over:
        warn_user(f"{path.parent}: functions that name no unit are taken to be in {unit}/N")
    target, scale = unit, 1.0 / float(system.get("length", 1.0))
    if over:
        target, convert = conversion(over, (unit, f"{unit}/N"))
        scale = convert.scale
    if target != unit:  # the ordinate's label is that of the whole quotient
        return scale
    force = conversion(under, ("N",))[1].scale if under else 1.0 / float(system.get("force", 1.0))
    return scale / force


def label_of(data: Mapping[str, Any], axis: str) -> str | None:
    """The unit of an axis of a data set 58, as its label says; None where it names none.

    Args:
        data: the data set.
        axis: "abscissa", "ordinate" or "orddenom".
    """
    label = str(data.get(f"{axis}_axis_units_lab") or "").strip()
    return None if label.lower() in _NO_UNIT else label
