"""Count the blows of logs, their damage, and what is left: `picchio count`."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterator, Sequence
from collections.abc import Mapping as Mapped
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from itertools import chain
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from picchio.campaign.channels import AXES
from picchio.campaign.importing.importer import ENDINGS
from picchio.campaign.importing.mapping import Mapping, read_mapping
from picchio.core.arrays import FloatArray, IndexArray
from picchio.core.errors import InputError, warn_user
from picchio.core.files import sha256
from picchio.core.processes import one_thread
from picchio.core.provenance import provenance
from picchio.core.results import TableResult
from picchio.fatigue.sn.curve import SNCurve
from picchio.ledger.blows import (
    Blow,
    Burst,
    Run,
    Shape,
    assumed,
    bursts,
    covered,
    measured,
    runs,
    within,
)
from picchio.ledger.changes import find, readings_of
from picchio.ledger.damage import (
    BurstDamage,
    Totals,
    burst_damages_of,
    fingerprint,
    resting,
    together,
    unscaled,
)
from picchio.ledger.drives import drives
from picchio.ledger.exchange import Exchange, exchange, signature
from picchio.ledger.forecast import Worlds, quantiles, worlds
from picchio.ledger.out import opc_ua
from picchio.ledger.ringing import ring_downs, temperatures
from picchio.ledger.samples import STEPS, Samples, by_names, read_samples
from picchio.ledger.store import Kept, Ledger, Stream
from picchio.model.many_poses import ManyPoses
from picchio.model.model import Model
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.loading.find import shipped_robot
from picchio.studies.default_task import task_of
from picchio.studies.rivet.life_rules import curves_of
from picchio.studies.rivet.pose import ModelAtPose
from picchio.studies.tasks import Operation, Task
from picchio.vibration.closed_form.response import unit_vector

_SHARE = 0.2  # of the task's force: what a blow exceeds where nobody says
_FOOT = 0.1  # of the threshold
_AT_REST = 12.0  # m/s^2: an accelerometer reads gravity, and its noise
_NEAR = 0.02  # rad or m: a robot that stands so near to a pose of the task works there
_SECONDS_A_DAY = 86_400
_LATELY = 28  # days that today's pace is taken from
_STATIONS = 12
MAPPING = "mapping.toml"


@dataclass(frozen=True, eq=False)
class Counted:
    """What a ledger holds, as blows and damage.

    Attributes:
        blows: by time.
        bursts: by time.
        damages: of each burst.
        totals: of all.
        spans: (s, 2) ns, the time that was logged.
    """

    blows: list[Blow]
    bursts: list[Burst]
    damages: list[BurstDamage]
    totals: Totals
    spans: IndexArray


@dataclass(frozen=True, eq=False, repr=False)
class Count(TableResult):
    """What the logs of a robot have done to it, and what is left.

    Attributes:
        model: the robot and its effects.
        ledger: its file.
        logs: how many it holds.
        added: names of the logs that are new.
        known: names of the logs that were counted before.
        refused: (name, why) of logs that could not be read.
        detected: what was found out about each new log.
        counted: blows and damage.
        worlds: what they may have done; None where nothing was counted.
        changes: what is no longer as it was.
        exchange: since when these look like another robot's logs; None where they do not.
        signature: what the robot's own readings are like, see `picchio.ledger.exchange`.
        curves: of the flexible joints.
        notes: what was taken for granted.
        origin: provenance.
    """

    INDEX = "name"
    PAGE: ClassVar[str] = "visuals.report.count:count_page"
    UNITS: ClassVar[dict[str, str]] = {"damage": "1", "blows_left_p50": "1"}

    model: Model
    ledger: Path
    logs: int
    added: tuple[str, ...]
    known: tuple[str, ...]
    refused: tuple[tuple[str, str], ...]
    detected: dict[str, tuple[str, ...]]
    counted: Counted
    worlds: Worlds | None
    changes: tuple[dict[str, Any], ...]
    exchange: Exchange | None
    signature: Mapped[str, tuple[float, float]]
    curves: tuple[SNCurve | None, ...]
    notes: tuple[str, ...]
    origin: dict[str, Any]

    @property
    def blows(self) -> int:
        """How many."""
        return len(self.counted.blows)

    @property
    def seen_share(self) -> float:
        """Of the blows whose size was logged; 1 where there is none."""
        seen = sum(blow.seen for blow in self.counted.blows)
        return seen / self.blows if self.blows else 1.0

    @property
    def hours(self) -> float:
        """h, the time that was logged."""
        spans = self.counted.spans
        return float((spans[:, 1] - spans[:, 0]).sum() / 3.6e12) if len(spans) else 0.0

    @property
    def blows_a_day(self) -> float:
        """Today's pace: over the last 28 days, or as many as there are; 0 of no blow."""
        if not self.blows:
            return 0.0
        last, first = self.counted.blows[-1].onset, self.counted.blows[0].onset
        span = _LATELY * _SECONDS_A_DAY * 1_000_000_000
        days = min(max((last - first) / 1e9 / _SECONDS_A_DAY, 1.0), _LATELY)
        return sum(blow.onset > last - span for blow in self.counted.blows) / days

    def left(self, joint: int) -> dict[str, float] | None:
        """P10, P50 and P90 of the blows until a joint's sum is one.

        Args:
            joint: which of the flexible ones.

        Returns:
            them by name; None without a curve, or where nothing was counted.
        """
        if self.worlds is None or self.curves[joint] is None:
            return None
        return quantiles(self.worlds.blows_left(joint, self.blows))

    def dates(self, left: dict[str, float] | None) -> dict[str, str | None]:
        """When so many blows will have come, at today's pace.

        Args:
            left: as `left` gives it.
        """
        found: dict[str, str | None] = {}
        for name in ("p10", "p50", "p90"):
            blows = math.inf if left is None else left[name]
            days = blows / self.blows_a_day if self.blows_a_day else math.inf
            found[name] = None
            if days < 36500:
                last = datetime.fromtimestamp(self.counted.blows[-1].onset / 1e9, UTC)
                found[name] = (last + timedelta(days=days)).date().isoformat()
        return found

    def reached(self, left: dict[str, float] | None) -> str | None:
        """The month in which the median of the blows left will have come, for people.

        Args:
            left: as `left` gives it.

        Returns:
            such as "2041-07"; None without end.
        """
        if left is None or not math.isfinite(left["p50"]):
            return None
        date = self.dates(left)["p50"]
        return "> 100 y" if date is None else date.rpartition("-")[0]

    @property
    def first_to_fail(self) -> int | None:
        """The joint that ends the life: the fewest blows left in the median; None of none."""
        left = [self.left(j) for j in range(len(self.curves))]
        finite = {j: x["p50"] for j, x in enumerate(left) if x and math.isfinite(x["p50"])}
        return min(finite, key=finite.__getitem__) if finite else None

    def if_force(self, factor: float) -> FloatArray:
        """(n,) how many times as long the joints live with all blows so many times as hard.

        Args:
            factor: of the force.
        """
        now = self.counted.totals.at(np.array([1.0, factor]))
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.where(now[:, 0] > 0.0, now[:, 0] / now[:, 1], np.nan))

    def days(self) -> list[dict[str, Any]]:
        """Of each day with blows: date, blows, and the damage of each joint."""
        if not self.counted.bursts:
            return []
        day = np.array([burst.onset for burst in self.counted.bursts]) // (86_400 * 10**9)
        blows = np.array([len(burst.blows) for burst in self.counted.bursts])
        found = []
        for which in np.unique(day):
            rows = day == which
            date = datetime.fromtimestamp(int(which) * _SECONDS_A_DAY, UTC).date().isoformat()
            found.append({"date": date, "blows": int(blows[rows].sum()),
                          "damage": self.counted.totals.shares[rows].sum(axis=0)})  # fmt: skip
        return found

    def stations(self) -> list[dict[str, Any]]:
        """Where the damage comes from: pose, direction, blows, share of each joint's damage."""
        if not self.counted.bursts:
            return []
        places: dict[tuple[float, ...], list[int]] = {}
        for k, burst in enumerate(self.counted.bursts):
            key = (*np.round(burst.pose / _NEAR).tolist(), *np.round(2 * burst.direction).tolist())
            places.setdefault(key, []).append(k)
        whole = np.maximum(np.nansum(self.counted.totals.shares, axis=0), 1e-300)
        found = []
        for rows in places.values():
            first = self.counted.bursts[rows[0]]
            found.append({
                "pose": first.pose, "direction": first.direction,
                "blows": sum(len(self.counted.bursts[k].blows) for k in rows),
                "share": self.counted.totals.shares[rows].sum(axis=0) / whole,
            })  # fmt: skip
        found.sort(key=lambda s: (-float(np.max(s["share"])), -s["blows"]))
        return found[:_STATIONS]

    def _headline(self) -> str:
        text = f"{self.blows} blows in {self.logs} log{'s' * (self.logs != 1)}"
        j = int(np.nanargmax(self.counted.totals.damage)) if self._any_damage else None
        if j is None:
            return f"{text}, no damage"
        names = self.model.robot.flexible_names
        text += f", {names[j]} has used {100 * self.counted.totals.damage[j]:.3g} % of its life"
        first = self.first_to_fail
        left = None if first is None else self.left(first)
        if first is None or left is None:
            return text
        low, middle, high = (float(f"{left[p]:.2g}") for p in ("p10", "p50", "p90"))
        text += f"; {names[first]} lasts {middle:,.0f} blows more"
        return f"{text} (P10 to P90: {low:,.0f} to {high:,.0f})"

    @property
    def _any_damage(self) -> bool:
        return bool(np.nan_to_num(self.counted.totals.damage).any())

    def _rows(self) -> list[dict[str, Any]]:
        rows = []
        for j, name in enumerate(self.model.robot.flexible_names):
            left = self.left(j) or {"p50": math.nan}
            rows.append({"name": name, "damage": float(self.counted.totals.damage[j]),
                         "blows_left_p50": left["p50"]})  # fmt: skip
        return rows

    def joints(self) -> list[dict[str, Any]]:
        """What is told of each joint."""
        found = []
        for j, name in enumerate(self.model.robot.flexible_names):
            left = self.left(j)
            known = self.worlds is not None and self.curves[j] is not None
            found.append({
                "name": name,
                "damage": float(self.counted.totals.damage[j]),
                "damage_interval": list(self.worlds.interval(j)) if known and self.worlds else None,
                "damage_each_alone": float(self.counted.totals.alone[j]),
                "blows_left": left,
                "date": self.dates(left) if left else None,
                "reason": None if self.curves[j] else "neither shaft nor drive with a curve",
            })  # fmt: skip
        return found

    def _content(self) -> dict[str, Any]:
        first = self.first_to_fail
        return {
            "format": "picchio-count/1",
            "robot": self.model.robot.name,
            "ledger": self.ledger,
            "logs": self.logs,
            "blows": self.blows,
            "seen_share": self.seen_share,
            "hours_logged": self.hours,
            "from": _iso(self.counted.blows[0].onset) if self.blows else None,
            "to": _iso(self.counted.blows[-1].onset) if self.blows else None,
            "blows_a_day": self.blows_a_day,
            "joints": self.joints(),
            "ends": None if first is None else self.model.robot.flexible_names[first],
            "force_10_percent_less": dict(
                zip(self.model.robot.flexible_names, self.if_force(0.9), strict=True)
            ),
            "changes": list(self.changes),
            "another_robot": self.exchange.to_dict() if self.exchange else None,
            "days": self.days(),
            "stations": self.stations(),
            "added": list(self.added),
            "known": list(self.known),
            "refused": [{"log": name, "why": why} for name, why in self.refused],
            "detected": {name: list(lines) for name, lines in self.detected.items()},
            "opc_ua": opc_ua(self),
            "notes": list(self.notes),
            "provenance": self.origin,
        }


def _iso(ns: int) -> str:
    return datetime.fromtimestamp(ns / 1e9, UTC).isoformat(timespec="milliseconds")


@one_thread()
def count(
    robot: FlexibleRobot | Model,
    log: str | Path | Sequence[str | Path] | None,
    ledger: str | Path,
    *,
    mapping: str | Path | Mapping | None = None,
    task: Task | str | Path | None = None,
    sn_curve: str | SNCurve | None = None,
    samples: int = 256,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> Count:
    """Count the blows that logs show and their damage, in a ledger that remembers them.

    A log that is counted twice counts once. It does not matter in which order logs come or where
    they are cut: the damage is that of all samples in the order of time.

    Args:
        robot: or a model of it.
        log: a log, some of them, or a folder of them; None counts what the ledger holds.
        ledger: its file, made where it is missing.
        mapping: what the logs' series are (`picchio-mapping/1`); `mapping.toml` in the folder
            where it is not given; without either the names of the first log's series must say.
        task: whose blows are assumed where none are seen, and a fifth of whose force a blow
            exceeds; the robot's own where it is not given.
        sn_curve: of all shafts, instead of their own.
        samples: worlds that are drawn, at most 256.
        seed: of the draws.
        progress: called with (logs done, logs in all).

    Returns:
        blows, damage, what is left.

    Raises:
        InputError: no log that can be read, a mapping that does not fit, another robot's ledger.
        OutputError: the ledger can't be written.
    """
    model = Model.of(robot)
    bare = model.robot
    curves = curves_of(bare, sn_curve)
    files, rules, rules_file, names = _files(log, mapping, bare)
    work = task_of(bare, task)
    added: list[str] = []
    known: list[str] = []
    refused: list[tuple[str, str]] = []
    detected: dict[str, tuple[str, ...]] = {}
    with Ledger(ledger, bare.name) as book:
        for number, file in enumerate(files):
            assert rules is not None
            try:
                lines = add_log(book, file, rules, model, work)
            except InputError as error:
                if len(files) == 1 or (error.key or "").startswith("blows."):
                    raise _to_map(error, file, bare, names) from None
                refused.append((file.name, str(error)))
                warn_user(f"not counted: {error}")
            else:
                (known if lines is None else added).append(file.name)
                if lines is not None:
                    detected[file.name] = lines
            if progress is not None:
                progress(number + 1, len(files))
        if files and not added and not known:
            raise InputError("no log could be read", file=files[0].parent)
        try:
            counted = recount(book, model, curves, work)
        except InputError as error:
            raise _to_map(error, files[0] if files else None, bare, names) from None
        logs = len(book.logs())
        readings = readings_of(model, counted.blows, book.features())
    changes, other = find(readings), exchange(readings)
    drawn = None
    if counted.bursts and any(curve is not None for curve in curves):
        day = np.array([b.onset for b in counted.bursts]) // (_SECONDS_A_DAY * 10**9)
        drawn = worlds(unscaled(model), curves, sn_curve, counted.bursts, counted.totals, day,
                       samples, seed)  # fmt: skip
    inputs = [*bare.files, *work.files, *([rules_file] if rules_file else [])]
    notes = (*names, *_notes(counted, rules, model))
    return Count(
        model=model, ledger=Path(ledger), logs=logs, added=tuple(added), known=tuple(known),
        refused=tuple(refused), detected=detected, counted=counted, worlds=drawn,
        changes=tuple(change.to_dict() for change in changes),
        exchange=other, signature=signature(readings) if other is None else other.before,
        curves=curves, notes=notes,
        origin=provenance(inputs, seed=seed),
    )  # fmt: skip


def _notes(counted: Counted, rules: Mapping | None, model: Model) -> tuple[str, ...]:
    """What was taken for granted."""
    robot = model.robot
    notes = [
        "each burst starts from rest where the robot has moved or come to rest; what the residues "
        "of all bursts close together counts, too, so that this is more than assess tells for the "
        "same rivets one by one",
    ]
    cut = sum(blow.cut for blow in counted.blows)
    if cut:
        notes.append(f"{cut} blows are cut by the end of a log whose neighbour is not there yet")
    kinds = {blow.kind for blow in counted.blows}
    if "acceleration" in kinds:
        notes.append(
            "sizes told from accelerations: peak times the mass that the tool feels; where "
            "several operations may be meant, the one that fits the axes best"
        )
    if kinds & {"trigger", "poses"}:
        notes.append("blows that no log shows are those of the task: number, size and shape")
    notes += model.without_load()
    unused = [effect.label for effect in model.effects if effect.where == "blows"]
    if unused and "force" in kinds:
        notes.append(f"measured blows are as they are, without {', '.join(unused)}")
    if rules is not None:
        given = {to.partition(".")[2] for _, to, _, _ in rules.entries}
        still = [name for name in robot.joint_names if name not in given]
        if still:
            notes.append(f"not logged, taken at zero: {', '.join(still)}")
        axes = {to[-1] for _, to, _, _ in rules.entries if to.startswith("force.")}
        if axes and (lacking := [f"force.{axis}" for axis in AXES if axis not in axes]):
            notes.append(f"not logged, taken as zero: {', '.join(lacking)}")
    return tuple(notes)


def _files(
    log: str | Path | Sequence[str | Path] | None,
    mapping: str | Path | Mapping | None,
    robot: FlexibleRobot,
) -> tuple[list[Path], Mapping | None, Path | None, tuple[str, ...]]:
    """The logs, their mapping, its file, and what was taken by its name where there is none."""
    if log is None:
        return [], mapping if isinstance(mapping, Mapping) else None, None, ()
    given = [Path(log)] if isinstance(log, str | Path) else [Path(x) for x in log]
    files: list[Path] = []
    for path in given:
        if not path.exists():
            raise InputError("no such file or folder", file=path)
        if path.is_dir():
            files += sorted(
                p for p in path.rglob("*") if p.suffix.lower() in ENDINGS and p.is_file()
            )
        else:
            files.append(path)
    if not files:
        raise InputError("holds no log", file=given[0], choices=ENDINGS)
    if isinstance(mapping, Mapping):
        return _unjoined(files, mapping), mapping, None, ()
    beside = given[0] / MAPPING if given[0].is_dir() else given[0].parent / MAPPING
    if mapping is None and not beside.is_file():
        rules, told = by_names(files[0], robot)
        if rules is None:
            raise InputError("needs a mapping from the logs' series to channels: no name says "
                             "which are the joints' angles", file=files[0], key="--mapping",
                             choices=robot.joint_names,
                             hint=_how_to_map(files[0], robot))  # fmt: skip
        return files, rules, None, tuple(f"no mapping: {line}" for line in told)
    rules_file = Path(mapping) if mapping is not None else beside
    rules = read_mapping(rules_file)
    return _unjoined(files, rules), rules, rules_file, ()


def _how_to_map(file: Path, robot: FlexibleRobot) -> str:
    shipped = shipped_robot(robot.name)
    known = shipped is not None and shipped.urdf == robot.files[0]
    return (f"`picchio import {file} --robot {robot.name if known else robot.files[0]} "
            f"--write-mapping {file.parent / MAPPING}` writes one to edit")  # fmt: skip


def _to_map(
    error: InputError, file: Path | None, robot: FlexibleRobot, names: tuple[str, ...]
) -> InputError:
    """The error; where there is no mapping that could say what is asked, how to make one."""
    if file is None or not names or not (error.key or "").startswith("blows."):
        return error
    return InputError(error.problem, file=error.file or file, key=error.key, choices=error.choices,
                      hint=f"it stands in a mapping: {_how_to_map(file, robot)}")  # fmt: skip


def _unjoined(files: list[Path], rules: Mapping) -> list[Path]:
    """The files less those that are joined to another, which are no logs of their own."""
    joined = {table.file.replace("{stem}", p.stem) for table in rules.join for p in files}
    return [p for p in files if p.name not in joined]


def stream_of(samples: Samples, rules: Mapping, task: Task, robot: FlexibleRobot) -> Stream:
    """The stream that a log belongs to.

    Args:
        samples: its first stretch.
        rules: its mapping.
        task: whose force tells what a blow exceeds.
        robot: whose masses tell which acceleration that is.

    Raises:
        InputError: a force along one direction that nobody states, a threshold that must be given.
    """
    asked = rules.blows
    kind, columns = samples.kind, samples.values.shape[1]
    threshold = asked.threshold if asked else None
    if threshold is None and kind in ("trigger", "poses"):
        threshold = 0.5
    if threshold is None and kind == "force":
        threshold = _SHARE * max(op.excitation.peak_force for op in task.operations)
    told = asked.model_dump(mode="json") if asked else {}
    settings = {k: told.get(k) for k in ("direction", "frame", "trigger", "operation")}
    rest = 0.0
    if kind == "acceleration":
        settings["sensor"] = list(samples.names)
        rest = _AT_REST * samples.names[0].startswith("accelerometer")
        if threshold is None:
            weakest = _felt_least(settings, task, robot)
            if weakest < 2.5 * rest:
                raise InputError(f"say what the reading exceeds in a blow: the task's blows are "
                                 f"{weakest:.3g} m/s^2, which gravity hides",
                                 key="blows.threshold", hint="such as 100.0, m/s^2")  # fmt: skip
            threshold = float(f"{max(_SHARE * weakest, 1.25 * rest):.2g}")
    assert threshold is not None
    usual = min(max(_FOOT * threshold, rest), threshold)
    foot = asked.foot if asked and asked.foot else usual
    if kind in ("trigger", "poses"):
        foot = threshold
    if foot > threshold:
        raise InputError("must not exceed the threshold", key="blows.foot", value=foot)
    if kind == "force" and columns == 1 and settings["direction"] is None:
        only = _operation(task, settings["operation"], None)
        settings["direction"], settings["frame"] = only.direction.tolist(), "world"
    return Stream(kind, samples.gap, columns, threshold, foot, settings)


def _operations(task: Task, name: str | None, pose: FloatArray | None) -> list[Operation]:
    """Those that may be meant: by name, by where the robot stands, or all."""
    if name is not None:
        for operation in task.operations:
            if operation.name == name:
                return [operation]
        raise InputError("the task has no such operation", key="blows.operation", value=name,
                         choices=[op.name for op in task.operations])  # fmt: skip
    if len(task.operations) == 1 or pose is None:
        return list(task.operations)
    near = [op for op in task.operations if (np.abs(op.poses - pose).max(axis=1) < _NEAR).any()]
    return near or list(task.operations)


def _operation(task: Task, name: str | None, pose: FloatArray | None) -> Operation:
    """The operation that is meant: by its name, by where the robot stands, or the only one."""
    meant = _operations(task, name, pose)
    if len(meant) == 1:
        return meant[0]
    raise InputError("several operations of the task may be meant: say which one",
                     key="blows.operation", choices=[op.name for op in meant])  # fmt: skip


def standing(samples: Samples, task: Task) -> Samples:
    """Where the robot stands at a pose of the task, as a trigger; other samples as they are.

    Args:
        samples: of a log.
        task: its poses.
    """
    if samples.kind != "poses":
        return samples
    near = np.zeros(len(samples.poses), dtype=bool)
    for operation in task.operations:
        for pose in operation.poses:
            near |= np.abs(samples.poses - pose).max(axis=1) < _NEAR
    return replace(samples, stamps=samples.pose_stamps, values=near[:, None].astype(float))


def add_log(
    book: Ledger, file: Path, rules: Mapping, model: Model, task: Task
) -> tuple[str, ...] | None:
    """Keep what matters of a log.

    Args:
        book: the ledger.
        file: the log.
        rules: its mapping.
        model: the robot whose it is.
        task: for what the log does not say.

    Returns:
        what was found out about it; None where it has been counted already.

    Raises:
        InputError: see `read_samples` and `stream_of`.
    """
    robot = model.robot
    parts = [file, *(file.parent / t.file.replace("{stem}", file.stem) for t in rules.join)]
    log = hashlib.sha256("".join(sha256(p) for p in parts if p.is_file()).encode()).hexdigest()
    plan = rules.model_dump(mode="json", exclude={"record", "campaign"}, by_alias=True)
    poses = [op.poses.tolist() for op in task.operations]
    forces = [op.excitation.peak_force for op in task.operations]
    told = json.dumps([plan, robot.joint_names, forces, poses], sort_keys=True)
    how = hashlib.sha256(told.encode()).hexdigest()
    if book.holds(log, how):
        return None
    try:
        stretches = read_samples(file, rules, robot)
        first = standing(next(stretches), task)
        stream = book.stream(stream_of(first, rules, task, robot))
        rest: Iterator[Samples] = (standing(part, task) for part in stretches)
        features: list[tuple[str, int, float]] = []
        spans: list[int] = []

        def looked_at() -> Iterator[Samples]:
            for part in chain([first], rest):
                spans.append(part.stamps.size)
                features.extend(ring_downs(part, stream, model))
                features.extend(temperatures(part))
                features.extend(drives(part, model))
                yield part

        book.add(log, how, file.name, stream, looked_at(), features)
    except StopIteration:
        raise InputError("is empty", file=file) from None
    except InputError as error:
        raise error if error.file is not None else error.placed(file=file) from None
    if len(spans) == 1:
        return first.detected
    # What was told of the rate was that of the first stretch.
    lines = (line.partition(", measured from")[0] for line in first.detected)
    return (*lines, f"{sum(spans)} samples")


def recount(book: Ledger, model: Model, curves: Sequence[SNCurve | None], task: Task) -> Counted:
    """All that a ledger holds, as blows and damage; what was computed before is taken from it.

    Args:
        book: the ledger.
        model: the robot and its effects.
        curves: of the flexible joints.
        task: whose blows are assumed where none are seen.

    Raises:
        InputError: see `measured`; a model without damping.
    """
    blows: list[Blow] = []
    over = np.empty((0, 2), np.int64)
    for kept in book.kept():
        spans = covered(kept.spans, kept.stream.gap)
        found = blows_of(kept, model, task)
        when = np.array([blow.onset for blow in found], np.int64)
        # A moment of the robot counts once: by the surest stream that saw it.
        blows += [b for b, hidden in zip(found, within(when, over), strict=True) if not hidden]
        over = covered(np.concatenate([over, spans]), kept.stream.gap)
    blows.sort(key=lambda blow: blow.onset)
    model = unscaled(model)  # the blows have their effects in them
    grouped = bursts(blows, resting(model))
    name = fingerprint(model, curves)
    known = book.computed(name)
    keys = [burst.key for burst in grouped]
    new = {key: burst for key, burst in zip(keys, grouped, strict=True) if key not in known}
    if new:
        made = burst_damages_of(model, curves, list(new.values()))
        fresh = {key: each.packed() for key, each in zip(new, made, strict=True)}
        book.remember(name, fresh)
        known |= fresh
    damages = [BurstDamage.unpacked(known[key], len(curves)) for key in keys]
    return Counted(blows, grouped, damages, together(damages, curves), over)


def blows_of(kept: Kept, model: Model, task: Task) -> list[Blow]:
    """The blows of a stream.

    Args:
        kept: what the ledger holds of it.
        model: the robot, and the effects on blows that are assumed.
        task: whose blows are assumed where none are seen.

    Raises:
        InputError: see `measured`; an operation that is not told.
    """
    settings, robot = kept.stream.settings, model.robot

    def turn(pose: FloatArray) -> FloatArray:
        return robot.frame_placement(pose, robot.tool_frame)[1]

    rotation = turn if settings.get("frame") == "tool" else None
    if kept.stream.kind == "force":
        given = settings.get("direction")
        along = None if given is None or kept.stream.columns == 3 else unit_vector(given)
        return measured(kept, along, rotation)
    found: list[Blow] = []
    shapes: dict[tuple[int, int], list[Shape]] = {}
    gains: dict[tuple[Any, ...], float] = {}
    for run in runs(kept):
        if not run.pose.size:
            raise InputError("no position was logged, so that nobody knows where the robot stood",
                             key="channel")  # fmt: skip
        if kept.stream.kind == "acceleration":
            meant = _operations(task, settings.get("operation"), run.pose)
            for jolt, peak in _jolts(run, kept.stream.threshold, meant[0]):
                blow = _felt(jolt, peak, settings, meant, task, model, shapes)
                found.append(_corrected(blow, kept, meant[0], model, gains))
            continue
        operation = _operation(task, settings.get("operation"), run.pose)
        period = operation.excitation.period
        length = (run.last - run.onset) * 1e-9
        hits = 1 if settings.get("trigger") == "blow" else 1 + int(length / period)
        if kept.stream.kind == "poses":
            hits = (
                operation.hits_per_rivet if length >= 0.5 * period * operation.hits_per_rivet else 0
            )
        found += assumed(run, operation, kept.stream.kind, hits, model, shapes)
    return found


def _jolts(run: Run, threshold: float, operation: Operation) -> list[tuple[Run, FloatArray]]:
    """The blows of a run, each with the largest reading, (k,) m/s^2.

    The arm's ringing and gravity hardly change while a blow lasts: they are the median of the
    samples around, over four times as long as a blow.
    """
    from scipy.ndimage import median_filter

    if run.stamps.size < 2:
        return []
    period = operation.excitation.period
    length = min(4.0 * (operation.excitation.width or 0.1 * period), 0.8 * period)
    around = max(1, round(0.5 * length * 1e9 / float(np.median(np.diff(run.stamps)))))
    slow = median_filter(run.values, (2 * around + 1, 1), mode="nearest")
    quick = run.values - slow
    size = np.linalg.norm(quick, axis=1)
    edge = np.diff((size > threshold).astype(np.int8), prepend=0, append=0)
    found = []
    for a, b in zip(np.flatnonzero(edge == 1), np.flatnonzero(edge == -1), strict=True):
        own = replace(run, onset=int(run.stamps[a]), last=int(run.stamps[b - 1]))
        found.append((own, quick[a + int(np.argmax(size[a:b]))]))
    return found


def _felt(
    run: Run, peak: FloatArray, settings: dict[str, Any], meant: list[Operation], task: Task,
    model: Model, shapes: dict[tuple[int, int], list[Shape]],
) -> Blow:  # fmt: skip
    """A blow of the task's shape, as large as the peak of the tool's acceleration tells.

    While a blow lasts the springs have not moved: a = J M^-1 J^T n F. Of the operations that may be
    meant that one is taken whose n fits the reading best.
    """
    if len(meant) > 1 and peak.size < 2:
        meant = [_operation(task, settings.get("operation"), run.pose)]
    best: tuple[float, float, Operation] | None = None
    for operation in meant:
        per = _answers(settings, operation, unscaled(model), run.pose[None])[0]
        force = float(peak @ per) / float(per @ per)
        left = float(np.linalg.norm(peak - force * per))
        if best is None or left < best[0] * (1.0 - 1e-9):
            best = left, abs(force), operation
    assert best is not None
    blow = assumed(run, best[2], "acceleration", 1, model, shapes)[0]
    return replace(blow, force=blow.force * (best[1] / blow.peak))


def _corrected(
    blow: Blow, kept: Kept, operation: Operation, model: Model, gains: dict[tuple[Any, ...], float]
) -> Blow:
    """The blow, less what the springs' pull is taken for.

    They do move a little while a blow lasts, and the arm's ringing is not quite what was read
    around it: how much too large that makes the task's own blows is computed, read as often as the
    log was and kept as it is, and taken out.
    """
    if model.nonlinear:
        return blow
    step = kept.stream.gap / STEPS
    key = (operation.name, *np.round(blow.pose / _NEAR), *np.round(blow.direction, 2))
    if key not in gains and step:
        excitation, hits = operation.excitation, operation.hits_per_rivet
        quiet = int(excitation.period / step * 1e9)
        time = step * 1e-9 * np.arange(quiet + int(hits * excitation.period / step * 1e9))
        response = ModelAtPose(unscaled(model), blow.pose).tool_response(excitation, hits)
        read = np.zeros((time.size, 3))
        read[quiet:] = response.acceleration(time[: time.size - quiet], blow.direction).T
        stamps = np.rint(1e9 * time).astype(np.int64)
        size = blow.peak / excitation.peak_force
        made = Kept(kept.stream, np.empty((0, 2), np.int64), stamps, size * read, stamps[:1],
                    blow.pose[None])  # fmt: skip
        mass, jacobian = ManyPoses(unscaled(model), blow.pose[None]).mass_and_jacobian()
        per = jacobian[0] @ np.linalg.solve(mass[0], blow.direction @ jacobian[0])
        told = [
            float(peak @ per) / (blow.peak * float(per @ per))
            for run in runs(made)
            for _, peak in _jolts(run, kept.stream.threshold, operation)
        ]
        gains[key] = float(np.mean(told)) if len(told) == hits else 1.0
    return replace(blow, force=blow.force / gains.get(key, 1.0))


def _answers(
    settings: dict[str, Any], operation: Operation, model: Model, poses: FloatArray
) -> FloatArray:
    """(p, k) what the sensor reads of a blow, m/s^2 a newton, in its own axes."""
    robot, found = model.robot, []
    mass, jacobian = ManyPoses(model, poses).mass_and_jacobian()
    sensor = settings.get("sensor") or ["acceleration"]
    kind, _, rest = sensor[0].partition(".")
    for k, pose in enumerate(poses):
        frame = robot.frame_placement(pose, robot.tool_frame)[1]
        along = model.force_directions(frame) @ operation.direction
        moved = jacobian[k] @ np.linalg.solve(mass[k], along @ jacobian[k])
        if not rest:  # its axis is not told: that of the blow
            found.append(np.array([along @ moved]))
            continue
        if kind == "accelerometer":
            moved = robot.frame_placement(pose, rest.rpartition(".")[0])[1].T @ moved
        found.append(moved[[AXES.index(name[-1]) for name in sensor]])
    return np.array(found)


def _felt_least(settings: dict[str, Any], task: Task, robot: FlexibleRobot) -> float:
    """m/s^2, what the sensor reads of the task's weakest blow."""
    model = Model.of(robot)
    return min(
        float(np.linalg.norm(_answers(settings, op, model, op.poses), axis=1).min())
        * op.excitation.peak_force
        for op in _operations(task, settings.get("operation"), None)
    )
