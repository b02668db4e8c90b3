"""Where a result comes from: version, seed, hashes of the inputs."""

from __future__ import annotations

import platform
from collections.abc import Iterable
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from picchio.core.files import sha256

_LIBRARIES = {"pin": "pinocchio", "numpy": "numpy", "scipy": "scipy"}


def package_version() -> str:
    """The installed version of picchio."""
    return _version("picchio") or "0+unknown"  # run from a source tree that is not installed


@cache
def _version(distribution: str) -> str | None:
    """Looked up once: a study of a thousand robots is a thousand results."""
    try:
        return version(distribution)
    except PackageNotFoundError:
        return None


def provenance(inputs: Iterable[str | Path] = (), *, seed: int | None = None) -> dict[str, Any]:
    """The record that every output carries.

    Args:
        inputs: files that were read; each is named with its SHA-256.
        seed: the random seed, where chance was used.

    Returns:
        versions (`picchio`, `python`, `libraries`), `seed`, and `inputs` with `file` and `sha256`.
    """
    files = sorted({Path(path).resolve() for path in inputs})
    return {
        "picchio": package_version(),
        "python": platform.python_version(),
        "libraries": {name: _version(own) for own, name in _LIBRARIES.items()},
        "seed": seed,
        "inputs": [{"file": path.name, "sha256": sha256(path)} for path in files],
    }
