"""A place found by hand as lines of a task file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from picchio.core.errors import InputError
from picchio.core.files import locked, read_text, write_text
from picchio.core.toml import parse_toml
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.studies.instant import Place
from picchio.studies.tasks import FORMAT, TaskTable, task_from_dict

_DIGITS = 9


def task_text(robot: FlexibleRobot, place: Place, before: str = "") -> str:
    """A task file with the place in it.

    Poses of one direction, blows and hits are one operation; else another one is begun.

    Args:
        robot: that stands there.
        place: pose, direction and blows.
        before: the file as it is; "" for a new one. Its comments stay.

    Returns:
        the file's content.

    Raises:
        InputError: a force that was measured, which no numbers state; what would not be a task.
    """
    import tomlkit

    if not place.excitation.programmed:
        raise InputError("a measured force cannot be written into a task; name its file there",
                         key="excitation", value=place.excitation.kind)  # fmt: skip
    document: Any = tomlkit.parse(before) if before else tomlkit.document()
    document.setdefault("format", FORMAT)
    stated = document.get("excitation", {})
    own = {**_blows(place), "hits_per_rivet": place.hits}
    pose, direction = _numbers(place.pose), _numbers(place.direction)
    tables = document.setdefault("operation", tomlkit.aot())
    for table in tables:
        has = {**stated, **table.get("excitation", {}), **table}
        has.setdefault("hits_per_rivet", document.get("hits_per_rivet", 12))
        same = all(has.get(key, 0.0 if key == "preload" else None) == own[key] for key in own)
        if same and "poses" in table and np.allclose(table["direction"], direction, atol=1e-9):
            table["poses"].append(pose)
            break
    else:
        table = tomlkit.table()
        names = {str(one.get("name")) for one in tables}
        count = next(k for k in range(1, len(names) + 2) if f"explored_{k}" not in names)
        table.add("name", f"explored_{count}")
        table.add("direction", direction)
        poses = tomlkit.array()
        poses.append(pose)
        table.add("poses", poses.multiline(True))
        table.add("hits_per_rivet", place.hits)
        table.add("excitation", {**_blows(place)})
        tables.append(table)
    text = tomlkit.dumps(document)
    if "points" not in text and "file" not in stated:
        task_from_dict(tomlkit.parse(text).unwrap(), robot)  # nothing is written that is no task
    return text


def add_place(path: Path, robot: FlexibleRobot, place: Place) -> int:
    """Write the place into a task file, a new one or one that stands there.

    Args:
        path: the file.
        robot: that stands there.
        place: pose, direction and blows.

    Returns:
        how many poses the file has now.

    Raises:
        InputError: the file is no task; as `task_text`.
        OutputError: it cannot be written there.
    """
    with locked(path, patience=5.0):
        before = ""
        if path.exists():
            parse_toml(path, TaskTable, format=FORMAT)
            before = read_text(path)
        text = task_text(robot, place, before)
        write_text(path, text)
    import tomlkit

    tables: Any = tomlkit.parse(text)["operation"]
    return sum(len(table.get("poses", table.get("points", []))) for table in tables)


def _blows(place: Place) -> dict[str, Any]:
    """The blows as an `[excitation]` table."""
    blows = place.excitation
    stated: dict[str, Any] = {"kind": blows.kind}
    for key in (*blows.needed, *blows.optional):
        value = getattr(blows, key, None)
        if value is not None:
            stated[key] = float(value) if isinstance(value, (int, float)) else value
    return stated


def _numbers(values: Any) -> list[float]:
    return [float(v) for v in np.round(values, _DIGITS) + 0.0]
