"""Many robots of one type: a ledger each, counted side by side, in one table."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from picchio.core.errors import InputError, OutputError, PicchioError
from picchio.core.files import printable_name
from picchio.core.html import sheet
from picchio.core.provenance import provenance
from picchio.core.results import TableResult
from picchio.core.spread import require_scheduler, spread
from picchio.core.unfinished import unfinished
from picchio.fatigue.sn.curve import SNCurve
from picchio.ledger.count import MAPPING, count
from picchio.ledger.result import Count
from picchio.ledger.store import drop_empty
from picchio.ledger.watch.exchange import Exchange, whose
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.studies.default_task import task_of
from picchio.studies.tasks import Task

ENDING = ".ledger"


@dataclass(frozen=True, eq=False)
class _Job:
    """What all robots of a fleet share."""

    robot: FlexibleRobot
    task: Task
    mapping: Path | None
    ledgers: Path
    sn_curve: str | SNCurve | None
    seed: int
    hours_per_day: float | None


@dataclass(frozen=True, eq=False, repr=False)
class Fleet(TableResult):
    """The counts of many robots.

    Attributes:
        robot: their type.
        robots: a summary each, the one with the most damage first.
        origin: provenance.
        failed: of the first robot whose ledger could not be written, if any.
    """

    BARS = ("damage",)
    PLOTS: ClassVar = {"bars": "visuals.plots.results:plot_columns"}
    LACKS: ClassVar = {"show": "it is about several robots"}

    UNITS: ClassVar[dict[str, str]] = {"damage": "1", "blows_left_p50": "1"}

    robot: str
    robots: tuple[dict[str, Any], ...]
    origin: dict[str, Any]
    failed: OutputError | None = None

    def require_counted(self) -> None:
        """Raise where a ledger could not be written, or nothing was counted.

        Raises:
            OutputError: as it was met.
            InputError: no robot could be counted.
        """
        if self.failed is not None:
            raise self.failed
        if all(row["error"] for row in self.robots):
            raise InputError(f"no robot could be counted: {self.robots[0]['error']}")

    def _headline(self) -> str:
        bad = sum(row["error"] is not None for row in self.robots)
        text = f"{len(self.robots)} robots, {sum(row['blows'] or 0 for row in self.robots)} blows"
        return text + (f"; {bad} could not be counted" if bad else "")

    def _rows(self) -> list[dict[str, Any]]:
        return [
            {"name": row["name"], "logs": row["logs"], "blows": row["blows"], "joint": row["joint"],
             "damage": row["damage"], "blows_left_p50": (row["blows_left"] or {}).get("p50"),
             "changes": len(row["changes"])}
            for row in self.robots
        ]  # fmt: skip

    def _repr_html_(self) -> str:
        heads = ("robot", "logs", "blows", "joint", "life used, %", "blows left, P10", "P50", "P90",
                 "P50 is reached", "changed", "not counted")  # fmt: skip
        rows = []
        for row in self.robots:
            left, date = row["blows_left"] or {}, row["date"] or {}
            used = None if row["damage"] is None else 100.0 * row["damage"]
            rows.append((
                row["name"], row["logs"], row["blows"], row["joint"], used, left.get("p10"),
                left.get("p50"), left.get("p90"), date.get("p50"),
                "; ".join(c["words"] for c in (*row["changes"], row["another_robot"])
                          if c), row["error"],
            ))  # fmt: skip
        return sheet(f"A fleet of {self.robot}", None, heads, rows, head=self._headline())

    def _content(self) -> dict[str, Any]:
        return {
            "format": "picchio-fleet/1",
            "robot": self.robot,
            "robots": list(self.robots),
            "provenance": self.origin,
        }


def count_fleet(
    robot: FlexibleRobot,
    logs: str | Path,
    ledgers: str | Path,
    *,
    mapping: str | Path | None = None,
    task: Task | str | Path | None = None,
    sn_curve: str | SNCurve | None = None,
    seed: int = 0,
    hours_per_day: float | None = None,
    workers: int | None = 1,
    scheduler: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Fleet:
    """Count the logs of many robots of one type.

    A robot that cannot be counted is told in its row; the others are counted all the same.

    Args:
        robot: their type.
        logs: a folder with a folder of logs for each robot, which names it.
        ledgers: a folder for a ledger each.
        mapping: of all logs; else `mapping.toml` in a robot's folder or in `logs`.
        task: as of `count`, like the rest.
        sn_curve: of all shafts.
        seed: of the draws.
        hours_per_day: h, that each robot works.
        workers: processes of a dask cluster of our own; 1 for none.
        scheduler: address of a dask scheduler, whose workers see the same files.
        progress: called with (robots done, robots in all).

    Returns:
        a row a robot.

    Raises:
        InputError: no folder, no robot in it, a scheduler that does not answer.
    """
    folder, books = Path(logs), Path(ledgers)
    if not folder.is_dir():
        raise InputError("no such folder", file=folder)
    if not books.is_dir():
        raise InputError("must be a folder, for a ledger each", file=books, key="ledger")
    names = sorted(p.name for p in folder.iterdir() if p.is_dir())
    if not names:
        raise InputError("holds no folder: each robot's logs are in one of its own", file=folder)
    work = task_of(robot, task)
    shared = Path(mapping) if mapping is not None else None
    if shared is None and (folder / MAPPING).is_file():
        shared = folder / MAPPING
    job = _Job(robot, work, shared, books, sn_curve, seed, hours_per_day)
    found = []
    with ExitStack() as ended:
        # A worker that is killed leaves its ledger as it is: an empty one does not stay.
        for book in (_book(books, name) for name in names):
            if not book.exists():
                ended.enter_context(unfinished(partial(Path, book), drop_empty))
        rows = _spread(job, [folder / name for name in names], workers, scheduler)
        for row in ended.enter_context(closing(rows)):
            found.append(row)
            if progress is not None:
                progress(len(found), len(names))
    _told_apart(found)
    failed = [error for row in found if (error := row.pop("_failed")) is not None]
    found.sort(key=lambda row: (-(row["damage"] or 0.0), row["name"]))
    inputs = [*robot.files, *work.files, *([shared] if shared else [])]
    return Fleet(robot.name, tuple(found), provenance(inputs, seed=seed), *failed[:1])


def _spread(
    job: _Job, folders: Sequence[Path], workers: int | None, scheduler: str | None
) -> Generator[dict[str, Any], None, None]:
    """A row for each folder, in any order."""
    if scheduler is None and workers == 1:
        yield from (_row(job, folder) for folder in folders)
        return
    if scheduler is not None:
        require_scheduler(scheduler)
    yield from spread(_row, job, folders, workers=workers, scheduler=scheduler)


def _book(folder: Path, name: str) -> Path:
    """A robot's ledger."""
    return folder / f"{name}{ENDING}"


def _row(job: _Job, folder: Path) -> dict[str, Any]:
    """One robot's summary."""
    own = folder / MAPPING
    mapping = job.mapping if job.mapping is not None and not own.is_file() else None
    row: dict[str, Any] = dict.fromkeys(
        ("logs", "blows", "seen_share", "joint", "damage", "damage_interval", "blows_left", "date",
         "error")
    )  # fmt: skip
    row |= {"name": printable_name(folder), "changes": [], "refused": [], "another_robot": None,
            "_exchange": None, "_signature": {}, "_failed": None}  # fmt: skip
    try:
        found = count(job.robot, folder, _book(job.ledgers, folder.name), mapping=mapping,
                      task=job.task, sn_curve=job.sn_curve, seed=job.seed,
                      hours_per_day=job.hours_per_day)  # fmt: skip
    except PicchioError as error:
        failed = error if isinstance(error, OutputError) else None
        return row | {"error": printable_name(str(error)), "_failed": failed}
    return row | _summary(found)


def _told_apart(rows: list[dict[str, Any]]) -> None:
    """Say of each exchange which robot of the fleet it looks like."""
    kept = {row["name"]: (row.pop("_exchange"), row.pop("_signature")) for row in rows}
    for row in rows:
        found: Exchange | None = kept[row["name"]][0]
        if found is None:
            continue
        others = {name: told for name, (_, told) in kept.items() if name != row["name"]}
        near = whose(found, others)
        told = found.to_dict() | {"like": near[0] if near else None}
        told["words"] += f"; they are like those of {near[0]}" if near else ""
        row["another_robot"] = told


def _summary(found: Count) -> dict[str, Any]:
    row: dict[str, Any] = {
        "logs": found.logs, "blows": found.blows, "seen_share": found.seen_share,
        "changes": list(found.changes), "_exchange": found.exchange, "_signature": found.signature,
        "refused": [{"log": name, "why": why} for name, why in found.refused],
    }  # fmt: skip
    damage = found.counted.totals.damage
    if np.isfinite(damage).any():
        joint = found.joints()[int(np.nanargmax(damage))]
        left = joint["blows_left"] and {
            k: None if math.isinf(v) else v for k, v in joint["blows_left"].items()
        }
        row |= {"joint": joint["name"], "damage": joint["damage"], "date": joint["date"],
                "damage_interval": joint["damage_interval"], "blows_left": left}  # fmt: skip
    return row
