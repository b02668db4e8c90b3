"""NumPy archives (.npz) and single arrays (.npy)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from picchio.campaign.importing.isolated import Limits
from picchio.campaign.importing.raw import RawFile, columns_of
from picchio.campaign.source import library
from picchio.core.tables import Column, Left

LIMITS = Limits(memory_a_byte=64.0)
_OBJECTS = "objects of Python, which could run code: save them as numbers (dtype float)"


def read(path: Path, clock: Mapping[str, Any]) -> RawFile:
    """Every array of one or two dimensions. Pickled objects are left out: they could run code.

    Args:
        path: the file.
        clock: the mapping's `[time]`.

    Raises:
        InputError: no archive, or one without numbers.
    """
    with library(".npz file", "numpy", path):
        return RawFile.of(path, "npz", _columns(path))


def _columns(path: Path) -> Iterator[Column | Left]:
    found = np.load(path, allow_pickle=False)
    if isinstance(found, np.ndarray):
        yield from columns_of(path.stem, found)
        return
    with found as archive:
        for name in archive.files:
            try:
                array = archive[name]
            except ValueError as error:
                if "allow_pickle" not in str(error):
                    raise
                yield Left(_OBJECTS, 1, 1, "", 1, name, "row")
                continue
            yield from columns_of(name, array)
