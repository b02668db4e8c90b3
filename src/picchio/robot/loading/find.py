"""Resolve a robot's name or path to a URDF file.

A name is looked up in this project's `robots/` and then in example-robot-data; anything that
looks like a path is taken as one. `package://` addresses go through the same roots as meshes.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from picchio.core.errors import InputError
from picchio.robot.annotations.sidecar import read_sidecar
from picchio.robot.urdf.addresses import example_share, resolve_package


@dataclass(frozen=True)
class FoundRobot:
    """A robot's files.

    Args:
        name: by which it can be loaded; None if it was given as a path.
        urdf: the URDF.
        flex: the folder's own flex.toml, or None.
        task: the folder's own task.toml, or None.
    """

    name: str | None
    urdf: Path
    flex: Path | None = None
    task: Path | None = None


def find_robot(robot: str | Path) -> FoundRobot:
    """Look a robot up.

    Raises:
        InputError: neither a file nor a known name, or a folder without robot.urdf.
    """
    text = os.fspath(robot)
    if not text or "\0" in text:
        raise InputError("is neither a robot name nor a path", key="ROBOT", value=text)
    if text.startswith("package://"):
        return FoundRobot(None, resolve_package(text))
    path = Path(text)
    try:
        is_file, is_folder = path.is_file(), path.is_dir()
    except OSError as error:  # such as a name too long for the system
        raise InputError(f"cannot be read: {error.strerror}", key="ROBOT", value=text) from None
    # A name never ends like a URDF and holds no separator unless it is a known one.
    if path.suffix in (".urdf", ".xacro", ".xml", ".toml") or is_file:
        if not is_file and not is_folder:
            raise InputError("no such file", file=path)
        return _with_neighbours(path)
    if is_folder and (path / "robot.urdf").is_file():
        return _with_neighbours(path / "robot.urdf")
    shipped = shipped_robot(text)
    if shipped is not None:
        return shipped
    found = example_robot(text)
    if found is not None:
        return FoundRobot(text, found)
    if is_folder:
        raise InputError("is a folder without robot.urdf", file=path, hint=_folder_hint(path))
    names = [*shipped_robots(), *example_robots()]
    raise InputError("no such robot", key="ROBOT", value=text, choices=names,
                     hint="a path to a URDF is fine, too")  # fmt: skip


def _folder_hint(folder: Path) -> str:
    here = folder.resolve()
    if here.parent == robots_folder().resolve() and shipped_robot(here.name):
        return f"ask for {here.name!r}"
    urdfs = [file.name for file in sorted(folder.glob("*.urdf"))[:5]]
    return f"name a URDF in it: {', '.join(urdfs)}" if urdfs else "there is no URDF in it"


def _with_neighbours(urdf: Path) -> FoundRobot:
    """A robot folder's own files belong to its robot.urdf alone."""
    if urdf.name != "robot.urdf":
        return FoundRobot(None, urdf)
    return FoundRobot(None, urdf, _if_file(urdf.parent / "flex.toml"),
                      _if_file(urdf.parent / "task.toml"))  # fmt: skip


def _if_file(path: Path) -> Path | None:
    return path if path.is_file() else None


def robots_folder() -> Path:
    """This project's robots: packaged with the wheel, or the checkout's own."""
    package = Path(__file__).resolve().parents[2]
    packaged = package / "_robots"
    return packaged if packaged.is_dir() else package.parent.parent / "robots"


def shipped_robots() -> dict[str, FoundRobot]:
    """The robots of this project by name."""
    folder = robots_folder()
    names = sorted(entry.name for entry in folder.iterdir()) if folder.is_dir() else []
    found = {name: shipped_robot(name) for name in names}
    return {name: robot for name, robot in found.items() if robot is not None}


def shipped_robot(name: str) -> FoundRobot | None:
    """One robot of this project, or None.

    A folder without a URDF has a flex.toml whose `robot` names one of example-robot-data.

    Raises:
        InputError: the folder's flex.toml cannot be read.
    """
    folder = robots_folder() / name
    if not name or folder.parent != robots_folder():
        return None
    urdf = _if_file(folder / "robot.urdf")
    flex = _if_file(folder / "flex.toml")
    if urdf is None and flex is not None:
        named = read_sidecar(flex).robot
        urdf = example_robot(named) if named else None
    return FoundRobot(name, urdf, flex, _if_file(folder / "task.toml")) if urdf else None


@cache
def example_robots() -> dict[str, Path]:
    """The URDFs of example-robot-data by name.

    The name is the file's; where two robots share it, their folder's name comes before it.
    """
    share = example_share()
    if share is None:
        return {}
    files = sorted((share / "example-robot-data" / "robots").glob("*/**/*.urdf"))
    stems = [file.stem for file in files]
    names: dict[str, Path] = {}
    for file in files:
        folder = file.relative_to(share / "example-robot-data" / "robots").parts[0]
        prefix = folder.removesuffix("_description")
        names[file.stem if stems.count(file.stem) == 1 else f"{prefix}/{file.stem}"] = file
    return names


def example_robot(name: str) -> Path | None:
    """A URDF of example-robot-data by its name, with or without "_robot" at its end."""
    robots = example_robots()
    return robots.get(name) or robots.get(f"{name}_robot")


def typed_name(name: str, urdf: Path) -> str:
    """What to type for a robot: its name where that finds it, else its URDF's path.

    Args:
        name: of the loaded robot.
        urdf: its file.

    Returns:
        the word, not quoted.
    """
    known = shipped_robot(name)
    found = known.urdf if known is not None else example_robot(name)
    return name if found == urdf else str(urdf)
