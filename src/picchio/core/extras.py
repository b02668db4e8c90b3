"""Packages that not everybody needs: they come with an extra, `pip install 'picchio[...]'`."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from picchio.core.errors import InputError


def need(package: str, what: str, extra: str) -> Any:
    """A package that comes with an extra.

    Args:
        package: its name.
        what: needs it, in words: "Zarr stores".
        extra: that has it.

    Returns:
        the module.

    Raises:
        InputError: it is not installed.
    """
    try:
        return import_module(package)
    except ImportError:
        hint = f"pip install 'picchio[{extra}]'"
        raise InputError(f"{what} need {package}", hint=hint) from None
