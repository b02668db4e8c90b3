"""Count the blows of logs, their damage, and what is left: `picchio count`."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from heapq import merge
from itertools import chain, islice
from pathlib import Path

import numpy as np

from picchio.campaign.channels import AXES
from picchio.campaign.importing.importer import ENDINGS
from picchio.campaign.importing.mapping import Mapping, read_mapping
from picchio.core.arrays import IndexArray
from picchio.core.errors import InputError, warn_user
from picchio.core.files import printable_name, regular_file, sha256
from picchio.core.processes import one_thread
from picchio.core.provenance import provenance
from picchio.core.shown import seeing
from picchio.core.unfinished import unfinished
from picchio.fatigue.sn.curve import SNCurve
from picchio.ledger.blows import Blow, bursts, covered, uncovered
from picchio.ledger.counted import Counted
from picchio.ledger.damage import burst_damages_of, fingerprint, resting, unscaled
from picchio.ledger.finding import blows_of, standing, stream_of
from picchio.ledger.forecast import UNLIKELY, Worlds, typical, worlds
from picchio.ledger.result import Count
from picchio.ledger.samples import Samples, by_names, read_samples
from picchio.ledger.store import MARGIN, SHIFT, Ledger, Stream, drop_empty
from picchio.ledger.watch.changes import Shown, find, readings_of
from picchio.ledger.watch.drives import drives
from picchio.ledger.watch.ringing import ring_downs, temperatures
from picchio.model.model import Model, ModelLike
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.loading.find import shipped_robot
from picchio.studies.default_task import TaskLike, task_of
from picchio.studies.rivet.life_rules import curves_of
from picchio.studies.tasks import Task

MAPPING = "mapping.toml"
_AT_ONCE = 256  # bursts that are held
_READ = 5  # what is read of a log: where that becomes more, logs that are there are read anew
_COUNTED = 2  # how a shift is counted: where that changes, shifts are counted anew


@one_thread()
def count(
    robot: ModelLike,
    log: str | Path | Sequence[str | Path] | None,
    ledger: str | Path,
    *,
    mapping: str | Path | Mapping | None = None,
    task: TaskLike = None,
    sn_curve: str | SNCurve | None = None,
    samples: int = 256,
    seed: int = 0,
    hours_per_day: float | None = None,
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
        hours_per_day: h, how long the robot works a day, as the logs show it; where it is not
            given, the calendar's pace of a day of logs and more.
        progress: called with (logs done, logs in all).

    Returns:
        blows, damage, what is left.

    Raises:
        InputError: no log that can be read, a mapping that does not fit, another robot's ledger.
        OutputError: the ledger can't be written.
    """
    if hours_per_day is not None and not 0.0 < hours_per_day <= 24.0:
        raise InputError("must be above 0 and at most 24 h", key="hours_per_day",
                         value=hours_per_day)  # fmt: skip
    model = Model.of(robot)
    bare = model.robot
    curves = curves_of(bare, sn_curve)
    files, rules, rules_file, names = _files(log, mapping, bare)
    work = task_of(bare, task)
    added: list[str] = []
    known: list[str] = []
    refused: list[tuple[str, str]] = []
    detected: dict[str, tuple[str, ...]] = {}
    new = not Path(ledger).exists()
    # A ledger that no log came into does not stay.
    kept = unfinished(lambda: Path(ledger), drop_empty) if new else nullcontext()
    with kept, Ledger(ledger, bare.name) as book:
        for number, file in enumerate(files):
            assert rules is not None
            try:
                lines = add_log(book, file, rules, model, work)
            except InputError as error:
                if len(files) == 1 or (error.key or "").startswith("blows."):
                    raise _to_map(error, file, bare, names) from None
                refused.append((printable_name(file), printable_name(str(error))))
                warn_user(f"not counted: {error}")
            else:
                name = printable_name(file)
                (known if lines is None else added).append(name)
                if lines is not None:
                    detected[name] = lines
            if progress is not None:
                progress(number + 1, len(files))
        if files and not added and not known:
            raise InputError("no log could be read", file=files[0].parent)
        try:
            counted = recount(book, model, curves, work)
        except InputError as error:
            raise _to_map(error, files[0] if files else None, bare, names) from None
        logs = len(book.logs())
    readings = readings_of(bare.flexible_names, counted.shown)
    changes = find(readings)
    drawn = None
    if counted.blows and any(curve is not None for curve in curves):
        drawn = worlds(unscaled(model), curves, sn_curve, counted, samples, seed)
    inputs = [*bare.files, *work.files, *([rules_file] if rules_file else [])]
    notes = (*names, *_notes(counted, rules, model), *_surprises(drawn, model))
    found = Count(
        model=model, ledger=Path(printable_name(str(ledger))), logs=logs,
        added=tuple(added), known=tuple(known), refused=tuple(refused), detected=detected,
        counted=counted, worlds=drawn,
        changes=tuple(change.to_dict() for change in changes),
        curves=curves, notes=notes, hours_per_day=hours_per_day,
        origin=provenance(inputs, seed=seed),
    )  # fmt: skip
    return seeing(found, robot=model, task=work)


def _surprises(drawn: Worlds | None, model: Model) -> list[str]:
    """Joints that should have failed by now; if one has, the ledger does not know it."""
    if drawn is None:
        return []
    found = [(n, drawn.whole(j)) for j, n in enumerate(model.robot.flexible_names)]
    return [
        f"{name} is whole in {100 * share:.2g} % of the drawn worlds: if it has not failed, it is "
        "stronger, or the blows are weaker, than is assumed, and what is left is told by few worlds"
        for name, share in found
        if share < UNLIKELY
    ]


def _notes(counted: Counted, rules: Mapping | None, model: Model) -> tuple[str, ...]:
    """What was taken for granted."""
    robot = model.robot
    notes = [
        "each burst starts from rest where the robot has moved or come to rest; what the residues "
        "of all bursts close together counts, too, so that this is more than assess tells for the "
        "same rivets one by one",
    ]
    if counted.cut:
        notes.append(
            f"{counted.cut} blows are cut by the end of a log whose neighbour is not there yet"
        )
    if counted.steady:
        notes.append(
            f"no separate blows in {counted.steady:.3g} s: the reading is as even as a turning "
            "tool's, and nothing is counted there"
        )
    if counted.forgotten:
        notes.append(
            f"{counted.forgotten} places that had done the least are not among those told: they "
            "were too many to tell apart; life and damage count all of them"
        )
    kinds = counted.kinds.keys()
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
        if rules.blows and rules.blows.pose is not None:
            given |= set(robot.joint_names)
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
            files += sorted(p for p in path.rglob("*") if _may_be_log(p))
        else:
            files.append(regular_file(path))
    if not files:
        raise InputError("holds no log", file=given[0], choices=ENDINGS)
    if isinstance(mapping, Mapping):
        return _unjoined(files, mapping), mapping, None, ()
    beside = given[0] / MAPPING if given[0].is_dir() else given[0].parent / MAPPING
    if mapping is None and not beside.exists():
        first = next((p for p in files if p.is_file()), files[0])
        rules, told = by_names(regular_file(first), robot)
        if rules is None:
            raise InputError("needs a mapping from the logs' series to channels: no name says "
                             "which are the joints' angles", file=files[0], key="--mapping",
                             choices=robot.joint_names,
                             hint=_how_to_map(files[0], robot))  # fmt: skip
        return files, rules, None, tuple(f"no mapping: {line}" for line in told)
    rules_file = Path(mapping) if mapping is not None else beside
    rules = read_mapping(rules_file)
    return _unjoined(files, rules), rules, rules_file, ()


def _may_be_log(path: Path) -> bool:
    """Whether a file in a folder ends like a log and is no result of picchio's, with its format."""
    if path.suffix.lower() not in ENDINGS or path.is_dir():
        return False
    if path.suffix.lower() != ".json" or not path.is_file():
        return True
    with open(path, "rb") as stream:
        return b'"format": "picchio-' not in stream.read(200)


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
    parts = [
        regular_file(file),
        *(file.parent / t.file.replace("{stem}", file.stem) for t in rules.join),
    ]
    # A month of logs is not read again for every count: path, size and time tell that it is known.
    seen = json.dumps([
        [str(p.resolve()), p.stat().st_size, p.stat().st_mtime_ns] for p in parts if p.is_file()
    ])  # fmt: skip
    plan = rules.model_dump(mode="json", exclude={"record", "campaign"}, by_alias=True)
    poses = [op.poses.tolist() for op in task.operations]
    forces = [(op.excitation.peak_force, op.excitation.period) for op in task.operations]
    told = json.dumps([plan, robot.joint_names, forces, poses, _READ], sort_keys=True)
    how = hashlib.sha256(told.encode()).hexdigest()
    if book.holds(seen, how, "file"):
        return None
    log = hashlib.sha256("".join(sha256(p) for p in parts if p.is_file()).encode()).hexdigest()
    if book.holds(log, how):
        return None
    try:
        stretches = read_samples(file, rules, robot)
        first = standing(next(stretches), task)
        stream = book.stream(stream_of(first, rules, task, robot))
        ends: list[str] = []
        rest = _until_cut(stretches, task, ends)
        sizes: list[int] = []

        def shown(part: Samples) -> Iterator[tuple[str, int, float]]:
            sizes.append(part.stamps.size)
            return chain(ring_downs(part, stream, model), temperatures(part), drives(part, model))

        book.add(log, how, printable_name(file), stream, chain([first], rest), shown, seen)
    except StopIteration:
        raise InputError("is empty", file=file) from None
    except InputError as error:
        raise error if error.file is not None else error.placed(file=file) from None
    if len(sizes) == 1:
        return (*first.detected, *ends)
    # What was told of the rate was that of the first stretch.
    lines = (line.partition(", measured from")[0] for line in first.detected)
    return (*lines, f"{sum(sizes)} samples", *ends)


def _until_cut(stretches: Iterator[Samples], task: Task, ends: list[str]) -> Iterator[Samples]:
    """The further stretches of a log that can be read; why it ends there is added to `ends`."""
    try:
        for part in stretches:
            yield standing(part, task)
    except InputError as error:
        ends.append(f"read up to here: {error}")
        warn_user(f"counted up to where it can't be read: {error}")


def recount(book: Ledger, model: Model, curves: Sequence[SNCurve | None], task: Task) -> Counted:
    """All that a ledger holds, as blows and damage; a shift whose logs are known is taken from it.

    Args:
        book: the ledger.
        model: the robot and its effects.
        curves: of the flexible joints.
        task: whose blows are assumed where none are seen.

    Raises:
        InputError: see `measured`; a model without damping.
    """
    streams, spans = streams_of(book)
    bare = unscaled(model)  # the blows have their effects in them
    blows_are = [_COUNTED, repr(model.key("blows")), [sha256(file) for file in model.robot.files],
                 [(op.name, op.direction.tolist(), op.poses.tolist(), op.hits_per_rivet,
                   repr(op.excitation)) for op in task.operations]]  # fmt: skip
    how = f"{fingerprint(bare, curves)}{json.dumps(blows_are)}"
    rest, found = resting(bare), Counted(curves)
    for number, logs in book.shifts().items():
        key = hashlib.sha256(f"{how}{logs}".encode()).hexdigest()
        text = book.told(number, key)
        if text is None:
            part, shown = Counted(curves), Shown(model)
            steady: dict[int, int] = {}
            blows = blows_held(book, streams, model, task, number * SHIFT, steady)
            grouped = bursts(blows, rest)
            while some := list(islice(grouped, _AT_ONCE)):
                part.add(some, burst_damages_of(bare, curves, some))
                shown.add(some)
            shown.read(book.features(number))
            part.steady = sum(ns for at, ns in steady.items() if at // SHIFT == number) * 1e-9
            text = json.dumps(part.told | {"shown": shown.told})
            book.tell(number, key, text)
        told = json.loads(text)
        found.merge(told)
        found.shown[number] = told["shown"]
    found.close(spans)
    found.typical = {
        each.onset: next(bursts(blows_held(book, streams, model, task, each.onset), rest))
        for each in set(typical(found.stretches) if found.stretches else ())
    }
    return found


Streams = list[tuple[Stream, IndexArray]]
"""With (s, 2) ns, the time that a more certain one saw."""


def streams_of(book: Ledger) -> tuple[Streams, IndexArray]:
    """The streams of a ledger, the surest first, and (s, 2) ns, the time that was logged.

    Args:
        book: the ledger.
    """
    found, over = [], np.empty((0, 2), np.int64)
    for stream, spans in book.streams():
        found.append((stream, over))
        over = covered(np.concatenate([over, covered(spans, stream.gap)]), stream.gap)
    return found, over


def blows_held(
    book: Ledger, streams: Streams, model: Model, task: Task, first: int,
    steady: dict[int, int] | None = None,
) -> Iterator[Blow]:  # fmt: skip
    """The blows of all logs of a ledger from some time until its shift ends, by time.

    Args:
        book: the ledger.
        streams: see `streams_of`.
        model: the robot and its effects.
        task: whose blows are assumed where none are seen.
        first: ns.
        steady: as of `blows_of`.

    Raises:
        InputError: see `blows_of`.
    """
    end = (first // SHIFT + 1) * SHIFT
    # A moment of the robot counts once: by the surest stream that saw it.
    sources = [
        uncovered(
            blows_of(
                stream, book.kept(stream, (first - MARGIN, end + MARGIN)), model, task, steady
            ),
            over,
        )
        for stream, over in streams
    ]
    found = merge(*sources, key=lambda blow: blow.onset)
    return (blow for blow in found if first <= blow.onset < end)
