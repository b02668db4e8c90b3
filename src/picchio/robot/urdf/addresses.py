"""Where the files that a URDF names are: `package://` addresses, and paths beside the URDF."""

from __future__ import annotations

import os
from collections.abc import Iterator
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from urllib.parse import unquote

from picchio.core.errors import InputError

_IN_PACKAGES = ("package://", "model://")
# Where each variable's folders keep their packages.
_VARIABLES = {"ROS_PACKAGE_PATH": "", "AMENT_PREFIX_PATH": "share", "GAZEBO_MODEL_PATH": "",
              "GZ_SIM_RESOURCE_PATH": ""}  # fmt: skip


@cache
def example_share() -> Path | None:
    """example-robot-data's root, which is also the root of its `package://` addresses.

    Returns:
        the folder, or None where it is not installed.
    """
    try:
        share = Path(str(distribution("example-robot-data").locate_file("cmeel.prefix/share")))
    except PackageNotFoundError:
        return None
    return share if (share / "example-robot-data").is_dir() else None


def package_roots() -> list[Path]:
    """Folders in which `package://<name>/...` and `model://<name>/...` are looked up.

    Returns:
        those of ROS 1, ROS 2 and Gazebo, by their variables, then example-robot-data's.
    """
    roots = [
        Path(entry) / inside
        for variable, inside in _VARIABLES.items()
        for entry in os.environ.get(variable, "").split(os.pathsep)
        if entry
    ]
    share = example_share()
    return [*roots, share] if share else roots


def resolve_package(address: str) -> Path:
    """The file behind a `package://` address.

    Args:
        address: of a URDF.

    Raises:
        InputError: in none of the roots.
    """
    return _resolve(address, None)


def resolve_mesh(address: str, folder: Path) -> Path:
    """The file behind a mesh address.

    Args:
        address: a `package://` or `model://` address, or a path; written with backslashes or
            percent signs, as Windows and the web have them, where no file has just this name.
        folder: of the URDF, from which paths count.

    Raises:
        InputError: not a local file, or not there.
    """
    if address.startswith(("http:", "https:", "ftp:")):
        raise InputError("meshes are not fetched from the network", value=address)
    return _resolve(address, folder)


def _resolve(address: str, folder: Path | None) -> Path:
    slashes = address.replace("\\", "/")
    for spelling in dict.fromkeys((address, slashes, unquote(address), unquote(slashes))):
        for path in _places(spelling, folder):
            if path.is_file():
                return path
    if not address.startswith(_IN_PACKAGES):
        raise InputError("no such mesh file", value=address)
    raise InputError("no package root has this file", value=address,
                     choices=[str(root) for root in package_roots()],
                     hint=f"set {' or '.join(list(_VARIABLES)[:2])}")  # fmt: skip


def _places(address: str, folder: Path | None) -> Iterator[Path]:
    if address.startswith(_IN_PACKAGES):
        inside = address.partition("://")[2]
        for root in package_roots():
            # A root may hold the package, or be it.
            yield from (root / inside, root.parent / inside)
        # A checkout keeps its packages above its URDF.
        for above in folder.resolve().parents if folder else ():
            yield from (above / inside, above / inside.partition("/")[2])
    elif folder is not None:
        yield folder / address.removeprefix("file://")
