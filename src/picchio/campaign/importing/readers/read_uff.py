"""Universal file format, data set 58: what modal-test systems export (needs pyuff)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from picchio.campaign.importing.isolated import Limits
from picchio.campaign.importing.raw import RawChannel, RawFile
from picchio.campaign.uff import data_sets, label_of, place
from picchio.core.errors import InputError, warn_user
from picchio.core.tables import Names

LIMITS = Limits(memory_a_byte=32.0)
# Function types of data set 58 that are histories in time: general, and time response.
_TIME_HISTORIES = (0, 1)
_TIME_ABSCISSA = (0, 17)
_FRF = (
    'a frequency response function needs no import: in campaign.toml, [[record]] with kind = "frf",'
    " file, and response and reference, such as 12+X"
)


def read(path: Path, clock: Mapping[str, Any]) -> RawFile:
    """Every time history of the file, named by its response node and direction, as "12+X".

    Spectra and FRFs are left out, with a warning.

    Raises:
        InputError: pyuff is missing, the file is no UFF, or holds no time history.
    """
    sets = data_sets(path)
    unique = Names()
    channels: dict[str, RawChannel] = {}
    skipped = 0
    for data in sets:
        if data.get("type") != 58:
            continue
        if int(data.get("func_type", 0)) not in _TIME_HISTORIES or (
            int(data.get("abscissa_spec_data_type", 0)) not in _TIME_ABSCISSA
        ):
            skipped += 1
            continue
        channel = _channel(data, unique, path)
        channels[channel.name] = channel
    if skipped:
        text = f"{path}: {skipped} data sets are no time histories and were left out"
        warn_user(text)
    if not channels:
        raise InputError("holds no time history in a data set 58", file=path, hint=_FRF if skipped
                         else None)  # fmt: skip
    still = [name for name, c in channels.items() if c.time is None]
    told = (f"no clock of its own, as the abscissa increment is 0: {', '.join(still)}",)
    return RawFile(path, "uff", channels, detected=told if still else ())


def _channel(data: dict[str, Any], unique: Names, path: Path) -> RawChannel:
    name = unique(place(data, "rsp"))
    values = np.asarray(data["data"])
    if values.dtype.kind == "c":
        raise InputError("holds complex numbers; only time histories can be imported",
                         file=path, key=name)  # fmt: skip
    if values.dtype.kind not in "fiub" or values.ndim != 1:
        raise InputError("is not a series of numbers", file=path, key=name)
    if values.size != int(data.get("num_pts", values.size)):
        raise InputError(f"must hold {int(data['num_pts'])} samples as its header says", file=path,
                         key=name, value=values.size)  # fmt: skip
    time = np.asarray(data["x"], dtype=np.float64)
    label = " ".join(str(data.get(key) or "").strip() for key in ("id1", "rsp_ent_name"))
    return RawChannel(
        name,
        values.astype(np.float64),
        time if time.size < 2 or np.ptp(time) > 0.0 else None,
        label_of(data, "ordinate"),
        note=label.strip(),
    )
