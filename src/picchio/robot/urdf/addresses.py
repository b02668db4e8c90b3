"""Where the files that a URDF names are: `package://` addresses, and paths beside the URDF."""

from __future__ import annotations

import os
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from picchio.core.errors import InputError


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
    """Folders in which `package://<name>/...` is looked up.

    Returns:
        those of ROS_PACKAGE_PATH, then example-robot-data's.
    """
    listed = os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)
    roots = [Path(entry) for entry in listed if entry]
    share = example_share()
    return [*roots, share] if share else roots


def resolve_package(address: str) -> Path:
    """The file behind a `package://` address.

    Args:
        address: of a URDF.

    Raises:
        InputError: in none of the roots.
    """
    inside = address.removeprefix("package://")
    for root in package_roots():
        # A root may hold the package, or be it.
        for path in (root / inside, root.parent / inside):
            if path.is_file():
                return path
    raise InputError("no package root has this file", value=address,
                     choices=[str(root) for root in package_roots()],
                     hint="set ROS_PACKAGE_PATH")  # fmt: skip


def resolve_mesh(address: str, folder: Path) -> Path:
    """The file behind a mesh address.

    Args:
        address: a `package://` address, or a path.
        folder: of the URDF, from which paths count.

    Raises:
        InputError: not a local file, or not there.
    """
    if address.startswith(("http:", "https:", "ftp:")):
        raise InputError("meshes are not fetched from the network", value=address)
    if address.startswith("package://"):
        try:
            return resolve_package(address)
        except InputError:
            # A checkout keeps its packages above its URDF.
            inside = address.removeprefix("package://")
            for above in folder.resolve().parents:
                for path in (above / inside, above / inside.partition("/")[2]):
                    if path.is_file():
                        return path
            raise
    path = folder / address.removeprefix("file://")
    if not path.is_file():
        raise InputError("no such mesh file", value=address)
    return path
