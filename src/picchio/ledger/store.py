"""The ledger on disk: an SQLite file of the samples that matter, each log in one transaction.

SQLite rather than Parquet with DuckDB: a log is added whole or not at all, also when the process is
killed; readers and a writer may work at once; a log that is counted anew replaces its rows; every
language reads it, DuckDB included (`ATTACH 'cell4.ledger' (TYPE sqlite)`), and it comes with
Python. What is kept is a set of samples with stamps, so that no order of logs and no cut between
them can matter: a union has none. `shift` holds what each eight hours add up to, by the logs and
the model that it was computed from, and may be emptied at any time.
"""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from picchio.core.arrays import BoolArray, FloatArray, IndexArray
from picchio.core.errors import InputError, OutputError
from picchio.core.files import is_stream
from picchio.core.guard import guard
from picchio.ledger.samples import Samples

FORMAT = "picchio-ledger/1"
_TABLES = """
CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT) WITHOUT ROWID;
CREATE TABLE stream (id TEXT PRIMARY KEY, kind TEXT, gap INTEGER, columns INTEGER, settings TEXT)
  WITHOUT ROWID;
CREATE TABLE log (id TEXT PRIMARY KEY, stream TEXT, mapping TEXT, name TEXT, first INTEGER,
  last INTEGER, samples INTEGER, detected TEXT, file TEXT) WITHOUT ROWID;
CREATE TABLE span (log TEXT, first INTEGER, last INTEGER);
CREATE TABLE run (log TEXT, first INTEGER, last INTEGER, stamps BLOB, sizes BLOB);
CREATE TABLE pose (log TEXT, first INTEGER, last INTEGER, stamps BLOB, sizes BLOB);
CREATE TABLE feature (log TEXT, name TEXT, stamp INTEGER, value REAL);
CREATE TABLE shift (number INTEGER PRIMARY KEY, key TEXT, told TEXT);
CREATE INDEX log_file ON log (file);
CREATE INDEX span_log ON span (log);
CREATE INDEX run_log ON run (log, first, last);
CREATE INDEX pose_log ON pose (log, first, last);
CREATE INDEX feature_log ON feature (log);
CREATE INDEX feature_stamp ON feature (stamp);
"""
_PATIENCE = 60.0  # s that a writer waits for another
_HELD = 1 << 17  # samples of a stream that are looked at together
_NEVER = 2**63 - 1  # ns
HOUR = 3600 * 10**9
"""ns."""
DAY = 24 * HOUR
"""ns."""
SHIFT = 8 * HOUR
"""ns: what happens in the same eight hours (UTC) is added up."""
MARGIN = 600 * 10**9
"""ns: what a shift adds up to depends on the samples so long before and after it, and on no other.
A tool that works on for longer counts from there."""


@dataclass(frozen=True)
class Stream:
    """What logs under one mapping have in common.

    Attributes:
        kind: see `picchio.ledger.samples.KINDS`.
        gap: ns: longer steps are gaps.
        columns: of the values.
        threshold: what a blow exceeds.
        foot: below this a blow is over.
        settings: the mapping's `[blows]`, and what else tells streams apart.
    """

    kind: str
    gap: int
    columns: int
    threshold: float
    foot: float
    settings: dict[str, Any] = field(default_factory=dict)

    @property
    def id(self) -> str:
        """What it is called: streams that see the same in the same way are one."""
        told = [self.kind, self.columns, self.threshold.hex(), self.foot.hex(), self.settings]
        return json.dumps(told, sort_keys=True)

    @property
    def hold(self) -> int:
        """Ns that are looked at before and after what exceeds the threshold; 0: to the foot."""
        return int(self.settings.get("hold") or 0)

    def size(self, values: FloatArray) -> FloatArray:
        """(m,) the size of samples (m, k), whatever their direction; a trigger has a sign.

        Args:
            values: of a force, an acceleration or a trigger.
        """
        if self.kind in ("trigger", "poses"):
            return values[:, 0] if values.shape[1] else np.zeros(len(values))
        return np.linalg.norm(values, axis=1)

    def active(
        self, stamps: IndexArray, size: FloatArray, anchors: Sequence[int] = (), ends: bool = False
    ) -> tuple[IndexArray, IndexArray]:
        """Where what may be a blow begins and ends: a run above the foot; all within `hold` of it.

        Args:
            stamps: (m,) ns, of a piece without gaps.
            size: (m,) of its samples.
            anchors: ns, of samples beside the piece that exceed the threshold, or may.
            ends: whether a run that touches an end of the piece may be one.

        Returns:
            (r,) first samples, (r,) those after the last.
        """
        if self.hold:
            over = np.sort(np.append(stamps[size > self.threshold], np.array(anchors, np.int64)))
            new = np.diff(over, prepend=over[:1] - 2 * self.hold - 1) > 2 * self.hold
            start = np.searchsorted(stamps, over[new] - self.hold)
            last = over[np.append(new[1:], True)] if over.size else over
            end = np.searchsorted(stamps, last + self.hold, side="right")
            return start[end > start], end[end > start]
        edge = np.diff((size > self.foot).astype(np.int8), prepend=0, append=0)
        start, end = np.flatnonzero(edge == 1), np.flatnonzero(edge == -1)
        if not start.size:
            return start, end
        good = np.maximum.reduceat(np.where(size > self.foot, size, 0.0), start) > self.threshold
        good |= ends & ((start == 0) | (end == size.size))
        return start[good], end[good]


@dataclass(frozen=True, eq=False)
class Kept:
    """What a ledger holds of a stream, or a part of it that begins and ends in silence.

    Attributes:
        stream: which.
        stamps: (m,) int64 ns, ascending, each once.
        values: (m, k).
        pose_stamps: (p,) int64 ns, ascending, each once.
        poses: (p, nv).
    """

    stream: Stream
    stamps: IndexArray
    values: FloatArray
    pose_stamps: IndexArray
    poses: FloatArray


def pieces(stamps: IndexArray, gap: int) -> Iterator[slice]:
    """The stretches between gaps.

    Args:
        stamps: (m,) ns, ascending.
        gap: ns.
    """
    cuts = np.flatnonzero(np.diff(stamps) > gap) + 1
    edges = [0, *cuts.tolist(), stamps.size]
    for first, last in zip(edges[:-1], edges[1:], strict=True):
        if last > first:
            yield slice(first, last)


def worth_keeping(
    samples: Samples, stream: Stream, before: Sequence[int] = (), after: Sequence[int] = ()
) -> tuple[BoolArray, IndexArray, FloatArray]:
    """The samples and the poses that a ledger must keep so that nothing depends on the log's ends.

    Of each stretch the first and the last sample; all that may be a blow (see `Stream.active`), or
    be with what another log has, with the sample before and after it. The pose where each begins,
    and while it lasts, and the first and last pose.

    Args:
        samples: of a log.
        stream: that it belongs to.
        before: ns, of what exceeded the threshold last, where the log has a stretch before it.
        after: ns, of what does so first in the stretch after it.

    Returns:
        (m,) which samples; (p,) ns, and (p, nv) the poses then.
    """
    size = stream.size(samples.values)
    keep = np.zeros(samples.stamps.size, dtype=bool)
    clock = samples.pose_stamps
    when: list[IndexArray] = [clock[:1], clock[-1:]]
    for piece in pieces(samples.stamps, stream.gap):
        here, stamps = keep[piece], samples.stamps[piece]
        inner = piece.start > 0, piece.stop < keep.size
        anchors = [*([stamps[0]] if inner[0] else before), *([stamps[-1]] if inner[1] else after)]
        for a, b in zip(*stream.active(stamps, size[piece], anchors, ends=True), strict=True):
            here[max(a - 1, 0) : b + 1] = True
            when.append(np.arange(stamps[a], stamps[b - 1] + 1, MARGIN))
        keep[piece.start] = keep[piece.stop - 1] = True
    told = np.unique(np.concatenate(when))
    at = np.searchsorted(clock, told, side="right") - 1
    return keep, told[at >= 0], samples.poses[at[at >= 0]]


def _beside(
    stretches: Iterable[Samples], stream: Stream
) -> Iterator[tuple[Samples, list[int], list[int]]]:
    """Each stretch, what exceeds the threshold last before it, and first after it, ns.

    At an end of the log, and at a gap, that is the end itself: another log may go on there.
    """
    last: list[int] = []
    held: tuple[Samples, list[int]] | None = None
    for samples in stretches:
        over = samples.stamps[stream.size(samples.values) > stream.threshold]
        begin, end = samples.stamps[:1].tolist(), samples.stamps[-1:].tolist()
        if held is not None:
            till = held[0].stamps[-1:].tolist()
            near = not begin or not till or begin[0] - till[0] <= stream.gap
            yield (*held, over[:1].tolist() if near else till)
            last = last if near else begin
        else:
            last = begin
        held = samples, last
        last = over[-1:].tolist() or last
        stop = end
    if held is not None:
        yield (*held, stop)


class _Union:
    """The samples of all logs of a stream in an interval of time, both ends included.

    Each stamp once, ascending, read as they are needed.
    """

    def __init__(self, book: Ledger, table: str, stream: Stream, interval: tuple[int, int]) -> None:
        self._book, self._table, self._interval, self._at = book, table, interval, 0
        rows = book.rows(
            f"SELECT {table}.first, {table}.rowid FROM {table} JOIN log ON log.id = {table}.log "
            f"WHERE log.stream = ? AND {table}.last >= ? AND {table}.first <= ?",
            stream.id, *interval,
        )  # fmt: skip
        self._rows = np.array([*sorted(rows), (_NEVER, 0)])
        columns = 0 if table == "pose" else stream.columns
        self._size = stream.size if columns else partial(np.linalg.norm, axis=1)
        self.stamps, self.values = np.empty(0, np.int64), np.empty((0, columns))

    @property
    def begin(self) -> int:
        """Ns, where what was not read yet begins."""
        return int(self._rows[self._at, 0])

    def read(self, last: int = _NEVER - 1, size: int = _NEVER) -> None:
        """Read what begins until `last`, ns, or until so many samples are held."""
        stamps, values = [self.stamps], [self.values]
        while self.begin <= last and sum(map(len, stamps)) < size:
            query = f"SELECT stamps, sizes FROM {self._table} WHERE rowid = ?"
            found = self._book.rows(query, int(self._rows[self._at, 1]))
            if not found:
                raise OutputError("was changed by another process meanwhile: run it again",
                                  file=self._book.path)  # fmt: skip
            stamps.append(np.frombuffer(found[0][0], "<i8"))
            values.append(np.frombuffer(found[0][1], "<f8").reshape(stamps[-1].size, -1))
            self._at += 1
        if len(stamps) == 1:
            return
        when, what = np.concatenate(stamps), np.concatenate([v for v in values if len(v)])
        # Two logs that disagree at a stamp: the larger sample, whichever came first.
        order = np.lexsort((*what.T, self._size(what), when))
        when, what = when[order], what[order]
        once = np.append(np.diff(when) > 0, True)
        once &= (when >= self._interval[0]) & (when <= self._interval[1])
        self.stamps, self.values = when[once], what[once]

    def drop(self, count: int) -> None:
        """Forget the first samples."""
        self.stamps, self.values = self.stamps[count:].copy(), self.values[count:].copy()


def drop_empty(path: Path) -> None:
    """Delete a ledger without logs, with what SQLite has beside it.

    Args:
        path: its file, which need not be there.
    """
    beside = [path.with_name(path.name + ending) for ending in ("-wal", "-shm", "-journal")]
    if not path.is_file():
        return
    # On a full disk SQLite can't make what it shares with others, and needs it for them alone.
    alone = not (beside[0].exists() and beside[0].stat().st_size)
    try:
        how = f"{path.absolute().as_uri()}?mode=ro{'&immutable=1' * alone}"
        with closing(sqlite3.connect(how, uri=True)) as base:
            tables = base.execute("SELECT name FROM sqlite_master WHERE name = 'log'").fetchall()
            held = bool(tables and base.execute("SELECT id FROM log LIMIT 1").fetchall())
    except sqlite3.DatabaseError:
        held = path.stat().st_size > 0
    for each in [] if held else [path, *beside]:
        each.unlink(missing_ok=True)


class Ledger:
    """An open ledger.

    Args:
        path: its file; made where it is missing.
        robot: its name; a ledger is one robot's.

    Raises:
        InputError: the file is no ledger, of another version, or another robot's.
        OutputError: it can't be read or written.
    """

    def __init__(self, path: str | Path, robot: str) -> None:
        self.path = Path(path)
        if is_stream(path) or self.path.is_dir():
            raise InputError("a ledger is a file", file=path)
        if not self.path.resolve().parent.is_dir():
            raise InputError("cannot write here: the folder does not exist", file=path)
        with self._told():
            self._base = sqlite3.connect(self.path, timeout=_PATIENCE, isolation_level=None)
            try:
                self._begin(robot)
            except BaseException:
                self._base.close()
                raise

    def _begin(self, robot: str) -> None:
        base = self._base
        base.execute("PRAGMA journal_mode = WAL")
        base.execute("PRAGMA synchronous = FULL")
        with self.writing():
            known = {name for (name,) in base.execute("SELECT name FROM sqlite_master")}
            if "meta" not in known:
                if known:
                    raise InputError("is a database, but no ledger", file=self.path)
                for statement in _TABLES.split(";"):
                    base.execute(statement)
                about = {"format": FORMAT, "robot": robot}
                base.executemany("INSERT INTO meta VALUES (?, ?)", about.items())
        found = dict(base.execute("SELECT key, value FROM meta"))
        if found.get("format") != FORMAT:
            raise InputError("unknown format", file=self.path, key="format",
                             value=found.get("format"), choices=[FORMAT])  # fmt: skip
        if found.get("robot") != robot:
            raise InputError("is the ledger of another robot", file=self.path, key="robot",
                             value=found.get("robot"), choices=[robot])  # fmt: skip

    @contextmanager
    def _told(self) -> Iterator[None]:
        """Within the block, what SQLite does not like is one line."""
        try:
            yield
        except sqlite3.DatabaseError as error:
            text = str(error)
            if "not a database" in text or "malformed" in text:
                raise InputError(f"is no ledger, or damaged: {text}", file=self.path) from None
            raise OutputError(f"cannot be written: {text}", file=self.path) from None

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Within the block, one transaction: all of it is kept, or nothing.

        Returns:
            a context manager.
        """
        with self._told():
            guard.check()
            self._base.execute("BEGIN IMMEDIATE")
            try:
                yield
                self._base.execute("COMMIT")
            except BaseException:
                if self._base.in_transaction:
                    self._base.execute("ROLLBACK")
                raise

    def rows(self, query: str, *values: object) -> list[Any]:
        """What a query finds.

        Args:
            query: of SQL.
            values: that stand for its question marks.
        """
        with self._told():
            return self._base.execute(query, values).fetchall()

    def close(self) -> None:
        """Close the file."""
        self._base.close()

    def __enter__(self) -> Ledger:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def holds(self, log: str, mapping: str, column: str = "id") -> bool:
        """Whether a log has been counted by this mapping.

        Args:
            log: hash of its content; or its file.
            mapping: hash of how it is read.
            column: "id", or "file".
        """
        return (mapping,) in self.rows(f"SELECT mapping FROM log WHERE {column} = ?", log)

    def stream(self, wanted: Stream) -> Stream:
        """The stream as the ledger has it: the gap stays what it was when it was new.

        Args:
            wanted: as a log has it.
        """
        found = self.rows("SELECT gap FROM stream WHERE id = ?", wanted.id)
        return replace(wanted, gap=found[0][0]) if found else wanted

    def add(
        self, log: str, mapping: str, name: str, stream: Stream, stretches: Iterable[Samples],
        features: Callable[[Samples], Iterable[tuple[str, int, float]]] = lambda _: (),
        file: str = "",
    ) -> int:  # fmt: skip
        """Keep what matters of a log; one that is held already is replaced.

        Args:
            log: hash of its content.
            mapping: hash of how it is read.
            name: of its file, for people.
            stream: that it belongs to.
            stretches: of the log, in any order.
            features: (name, ns, value) of single numbers that a stretch shows.
            file: what tells that it is the same without reading it.

        Returns:
            how many samples it had.
        """
        with self.writing():
            base = self._base
            for table in ("span", "run", "pose", "feature"):
                base.execute(f"DELETE FROM {table} WHERE log = ?", (log,))
            settings = json.dumps([stream.threshold, stream.foot, stream.settings], sort_keys=True)
            base.execute(
                "INSERT OR IGNORE INTO stream VALUES (?, ?, ?, ?, ?)",
                (stream.id, stream.kind, stream.gap, stream.columns, settings),
            )
            first, last, count = _NEVER, 0, 0
            detected: tuple[str, ...] = ()
            stood: Samples | None = None
            for samples, before, after in _beside(stretches, stream):
                clock = samples.stamps if samples.stamps.size else samples.pose_stamps
                if not clock.size:
                    continue
                stood = samples.standing_as(stood)
                keep, when, poses = worth_keeping(stood, stream, before, after)
                detected = detected or samples.detected
                count += clock.size
                first, last = min(first, int(clock[0])), max(last, int(clock[-1]))
                spans = [(log, int(clock[p][0]), int(clock[p][-1]))
                         for p in pieces(clock, stream.gap)]  # fmt: skip
                base.executemany("INSERT INTO span VALUES (?, ?, ?)", spans)
                for table, stamps, values in (
                    ("run", samples.stamps[keep], samples.values[keep]),
                    ("pose", when, poses),
                ):
                    if stamps.size:
                        row = (log, int(stamps[0]), int(stamps[-1]), _packed(stamps, "<i8"),
                               _packed(values, "<f8"))  # fmt: skip
                        base.execute(f"INSERT INTO {table} VALUES (?, ?, ?, ?, ?)", row)
                base.executemany("INSERT INTO feature VALUES (?, ?, ?, ?)",
                                 [(log, *each) for each in features(samples)])  # fmt: skip
            told = json.dumps(detected)
            about = (log, stream.id, mapping, name, first, last, count, told, file)
            base.execute("INSERT OR REPLACE INTO log VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", about)
        return count

    def logs(self) -> list[tuple[str, str, int, int, int]]:
        """Every log by time: (id, name, first ns, last ns, samples)."""
        return self.rows("SELECT id, name, first, last, samples FROM log ORDER BY first, id")

    def streams(self) -> list[tuple[Stream, IndexArray]]:
        """Each stream with logs, the surest kinds first, and the time that was logged.

        Returns:
            streams with (s, 2) int64 ns, in any order, overlaps included.
        """
        from picchio.ledger.samples import KINDS

        found = []
        for key, *about, settings in self.rows(
            "SELECT id, kind, gap, columns, settings FROM stream"
        ):
            spans = self.rows("SELECT span.first, span.last FROM span JOIN log ON "
                              "log.id = span.log WHERE log.stream = ?", key)  # fmt: skip
            if spans:
                stream = Stream(*about, *json.loads(settings))
                found.append((stream, np.array(spans, np.int64)))
        return sorted(found, key=lambda each: (KINDS.index(each[0].kind), each[0].id))

    def kept(self, stream: Stream, interval: tuple[int, int] = (0, _NEVER)) -> Iterator[Kept]:
        """What is held of a stream, by time, in parts: memory does not grow with the ledger.

        A part ends at a gap or at a sample below the foot, which the next one begins with, so that
        no run is cut. Each part has the last pose before it.

        Args:
            stream: as `streams` gives it.
            interval: ns, first and last sample.

        Raises:
            OutputError: another process changed the ledger meanwhile.
        """
        held, poses = (_Union(self, table, stream, interval) for table in ("run", "pose"))
        while not poses.stamps.size and poses.begin < _NEVER:
            poses.read(size=1)  # where a run is before every pose, the first counts
        while True:
            held.read(size=2 * held.stamps.size + _HELD)
            ended = held.begin == _NEVER
            # Another log may yet have samples from there on.
            known = held.stamps[: np.searchsorted(held.stamps, held.begin)]
            below = stream.size(held.values[: known.size]) <= stream.foot
            quiet = np.flatnonzero(below & (not stream.hold))[-1:]
            apart = np.flatnonzero(np.diff(known) > stream.gap)[-1:] + 1
            begin = known.size if ended else max([0, *quiet, *apart])
            if begin == 0 and not ended:
                continue
            end = begin + int(not ended and begin in quiet)
            poses.read(last=int(known[:end][-1:].max(initial=0)))
            yield Kept(stream, held.stamps[:end], held.values[:end], poses.stamps, poses.values)
            if ended:
                return
            held.drop(begin)
            at = np.searchsorted(poses.stamps, held.stamps[0], side="right")
            poses.drop(max(int(at) - 1, 0))

    def features(self, shift: int) -> list[tuple[str, int, float]]:
        """(name, ns, value) of a shift, each once, by time, name and value.

        Args:
            shift: its number.
        """
        return self.rows(
            "SELECT DISTINCT name, stamp, value FROM feature WHERE stamp >= ? AND stamp < ? "
            "ORDER BY stamp, name, value", shift * SHIFT, (shift + 1) * SHIFT,
        )  # fmt: skip

    def shifts(self) -> dict[int, str]:
        """Each shift that was logged, by time.

        Returns:
            {number: hash of the logs that it depends on}.
        """
        logs: dict[int, set[str]] = {}
        self._version = self.rows("PRAGMA data_version")
        for log, mapping, first, last in self.rows(
            "SELECT log.id, mapping, span.first, span.last FROM span JOIN log ON log.id = log"
        ):
            for number in range((first - MARGIN) // SHIFT, (last + MARGIN) // SHIFT + 1):
                logs.setdefault(number, set()).add(log + mapping)
        return {
            number: hashlib.sha256("".join(sorted(logs[number])).encode()).hexdigest()
            for number in sorted(logs)
        }

    def told(self, shift: int, key: str) -> str | None:
        """What a shift adds up to, if it is known.

        Args:
            shift: its number.
            key: of all that it depends on.
        """
        found = self.rows("SELECT told FROM shift WHERE number = ? AND key = ?", shift, key)
        return found[0][0] if found else None

    def tell(self, shift: int, key: str, told: str) -> None:
        """Keep what a shift adds up to, unless another process has changed the ledger meanwhile.

        Args:
            shift: its number.
            key: of all that it depends on.
            told: as text.
        """
        with self.writing():
            if self.rows("PRAGMA data_version") == self._version:
                row = (shift, key, told)
                self._base.execute("INSERT OR REPLACE INTO shift VALUES (?, ?, ?)", row)


def _packed(values: FloatArray, kind: str) -> bytes:
    return np.ascontiguousarray(values, dtype=kind).tobytes()
