"""Variables of a .mat file, with errors that name the file."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from picchio.core.errors import InputError


def load_variables(path: Path, names: Sequence[str]) -> dict[str, Any]:
    """The variables named; structs as objects with their fields.

    Raises:
        InputError: no .mat file, or a variable is missing.
    """
    from scipy.io import loadmat

    try:
        with warnings.catch_warnings():
            # The KUKA files hold one opaque MATLAB object beside the data.
            warnings.simplefilter("ignore")
            found = loadmat(path, squeeze_me=True, struct_as_record=False, variable_names=names)
    except Exception as error:  # scipy raises many kinds on a broken file
        reason = str(error).partition("\n")[0]
        raise InputError(f"is not a readable .mat file: {reason}", file=path) from None
    for name in names:
        if name not in found:
            raise InputError("the variable is missing", file=path, key=name)
    return {name: found[name] for name in names}
