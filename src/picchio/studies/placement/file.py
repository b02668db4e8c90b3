"""The task of a placement as a file: poses, directions and hit rate of the best place."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

import numpy as np

from picchio.core.files import read_text, write_text
from picchio.studies.placement.result import Placement
from picchio.studies.placement.work import Work
from picchio.studies.tasks import FORMAT, Task

_DIGITS = 12


def write_task(found: Placement, work: Work, task: Task, out: Path) -> None:
    """Write the task with the work moved, everything else as in its file.

    Every operation has poses: points would leave the choice of branch, roll and null space.

    Args:
        found: the placement.
        work: the work that was moved.
        task: as it was read, or assumed.
        out: where to write.
    """
    import tomlkit

    spot = found.best.spot
    source = task.files[0] if task.files else None
    document = tomlkit.parse(read_text(source) if source else tomlkit.dumps(_plain(task)))
    turn = work.turn(spot.move[3])
    shift = ", ".join(f"{c:.4f}" for c in spot.move[:3])
    about = ", ".join(f"{c:.4f}" for c in work.centre)
    heading = math.degrees(spot.move[3])
    whose = source.name if source else "an assumed task"
    head = (
        f"# The work of {whose}, moved by picchio place: shifted by ({shift}) m and turned\n"
        f"# by {heading:.3f} deg about the vertical through ({about}) m. Poses, directions and\n"
        "# period below are the moved ones; older comments may speak of what was.\n"
    )
    tables: Any = document["operation"]
    for k, (table, operation) in enumerate(zip(tables, task.operations, strict=True)):
        own = work.operation == k
        for key in ("points", "branch", "poses", "direction"):
            table.pop(key, None)
        table["direction"] = _numbers(turn @ operation.direction)
        rows = tomlkit.array()
        rows.multiline(True)
        for pose in spot.poses[own]:
            rows.append(_numbers(pose))
        table["poses"] = rows
        _set_period(table, spot.period, own=True)
        _relocate(table, source, out)
        if isinstance(table.get("excitation"), dict):
            _set_period(table["excitation"], spot.period, own=True)
            _relocate(table["excitation"], source, out)
    if "excitation" in document or spot.period is not None:
        common: Any = document.setdefault("excitation", tomlkit.table())
        _set_period(common, spot.period, own=False)
        _relocate(common, source, out)
    write_text(out, head + tomlkit.dumps(document))


def _numbers(values: Any) -> list[float]:
    return [float(v) for v in np.round(values, _DIGITS) + 0.0]


def _set_period(table: Any, period: float | None, *, own: bool) -> None:
    """The best hit rate; of an operation only where it has one of its own."""
    if period is not None and (not own or "period" in table):
        table["period"] = float(f"{period:.9g}")


def _plain(task: Task) -> dict[str, Any]:
    """Keys and values of a task that has no file, but for its poses and directions."""
    first = task.operations[0]
    blows = {key: value for key, value in first.excitation.to_dict().items() if value is not None}
    return {
        "format": FORMAT,
        "hits_per_rivet": first.hits_per_rivet,
        "excitation": blows,
        "operation": [{"name": operation.name} for operation in task.operations],
    }


def _relocate(table: Any, source: Path | None, out: Path) -> None:
    """A measured blow is named relative to the file that names it."""
    if source is not None and "file" in table:
        there = (source.parent / str(table["file"])).resolve()
        table["file"] = os.path.relpath(there, out.resolve().parent)
