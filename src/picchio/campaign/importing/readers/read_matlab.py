"""MATLAB .mat files: variables, structs, and, where mat-io is there, tables and version 7.3."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from picchio.campaign.importing.isolated import Limits
from picchio.campaign.importing.raw import RawFile, columns_of
from picchio.campaign.source import library
from picchio.core.errors import InputError

LIMITS = Limits(seconds_a_byte=2.5e-7)


def read(path: Path, clock: Mapping[str, Any]) -> RawFile:
    """Every vector, and every row of a matrix, of the variables, tables and structs' fields.

    A series is named as MATLAB spells it: `t`, `rec.force`, and `rec.position(2)` for the second
    of a matrix's rows (of its columns, where there are fewer columns than rows).

    Raises:
        InputError: no .mat file, a damaged one, or one without numbers.
    """
    try:
        from matio import load_from_mat as load
    except ImportError:
        from scipy.io import loadmat as load
    with library(".mat file", "scipy", path):
        try:
            content = load(path)
        except NotImplementedError:
            raise InputError("is a version 7.3 file (HDF5), which needs mat-io", file=path,
                             hint="pip install 'picchio[import]', or save it with '-v7'"
                             ) from None  # fmt: skip
    named = {name: value for name, value in content.items() if not name.startswith("__")}
    return RawFile.of(path, "matlab", columns_of("", named))
