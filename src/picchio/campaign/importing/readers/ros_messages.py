"""What the messages of a ROS log hold, as series: the same for MCAP, .db3 and .bag.

Messages of one topic mostly have their numbers at the same places. Those places are found once, by
walking through a message as its definition says, and the numbers of all alike are then taken out
together: a thousand times as fast as decoding one message after the other.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from picchio.campaign.importing.raw import RawChannel, RawFile
from picchio.campaign.importing.readers.read_json_lines import by_key
from picchio.campaign.source import library
from picchio.core.arrays import FloatArray, IndexArray
from picchio.core.errors import InputError, warn_user
from picchio.core.tables import Column

Fields = Mapping[str, Any]
"""Of each kind of message, as rosbags has them: (constants, [(field, how it is written)])."""
Numbers = tuple[str, tuple[str | None, str | None], IndexArray, FloatArray]
AT_ONCE = 1 << 16
"""Messages of a topic that are taken apart at a time."""
_NANO = 1_000_000_000
_DEEPEST = 6
# An array of more numbers is an image or a cloud, no reading.
_LONGEST = 64
_JOINT_FIELDS = {"position": ("position", "rad"), "velocity": ("velocity", "rad/s"),
                 "effort": ("torque", "N*m")}  # fmt: skip
_VECTORS: dict[str, dict[str, tuple[str | None, str]]] = {
    "Imu": {"linear_acceleration": ("accelerometer", "m/s^2"), "angular_velocity": (None, "rad/s")},
    "AccelStamped": {"accel.linear": ("acceleration", "m/s^2"), "accel.angular": (None, "rad/s^2")},
    "WrenchStamped": {"wrench.force": (None, "N"), "wrench.torque": (None, "N*m")},
}
_NUMBERS = {"bool": "u1", "byte": "u1", "octet": "u1", "char": "u1", "uint8": "u1", "int8": "i1",
            "uint16": "u2", "int16": "i2", "uint32": "u4", "int32": "i4", "uint64": "u8",
            "int64": "i8", "float32": "f4", "float64": "f8"}  # fmt: skip
_BASE, _NAME, _ARRAY = 1, 2, 3  # rosbags' node types; the fourth is a sequence
# Messages that are alike no more than in ones and twos are not compared with each other.
_UNLIKE = 32
_STAMPS = ("header.stamp", "timestamp", "stamp")
_BEGIN = 4  # bytes before a message in CDR, which say how its numbers are written


@dataclass(frozen=True, eq=False)
class _Layout:
    """Where the numbers of messages stand that are alike.

    Attributes:
        numbers: (series, place, type) of each.
        about: (unit, suggested channel) of each.
        stamp: place and type of the header's stamp, if there is one.
        fixed: places of the bytes that decide all this: lengths and names.
    """

    numbers: list[tuple[str, int, str]]
    about: list[tuple[str | None, str | None]]
    stamp: tuple[int, str] | None
    fixed: IndexArray


class _Walk:
    """A message, read from its beginning to its end: which number stands where.

    Source: OMG, DDS Interoperability Wire Protocol 2.5, clause 10 (CDR); the ROS 1 wiki, "msg".
    """

    def __init__(self, data: bytes, kind: str, fields: Fields, ros1: bool) -> None:
        self.data, self.fields, self.ros1 = data, fields, ros1
        self.short = kind.rpartition("/")[2]
        self.named = self.short == "JointState" or self.short in _VECTORS
        self.at, self.order = (0, "<") if ros1 else (_BEGIN, "<>"[data[1] == 0])
        if not ros1 and (data[0] or data[1] > 1):
            raise ValueError(f"messages of {kind} are written in a way that is not known")
        self.numbers: dict[str, tuple[int, str]] = {}
        self.strings: dict[str, str] = {}
        self.fixed: list[np.ndarray] = []
        self._message(kind, "", _DEEPEST, True)
        if self.at > len(data):
            raise ValueError(f"a message of {kind} is cut short")

    def _align(self, size: int) -> None:
        if not self.ros1:
            self.at += -(self.at - _BEGIN) % size

    def _count(self) -> int:
        self._align(4)
        (count,) = struct.unpack_from(f"{self.order}I", self.data, self.at)
        self.fixed.append(np.arange(self.at, self.at + 4))
        self.at += 4
        if count > len(self.data):
            raise ValueError("a message is shorter than it says")
        return int(count)

    def _message(self, kind: str, name: str, depth: int, told: bool) -> None:
        for part, how in self.fields[kind][1]:
            inner = f"{name}.{part}" if name else part
            self._value(how, inner, depth, told and part != "header" and not part.startswith("_"))

    def _value(self, how: Any, name: str, depth: int, told: bool) -> None:
        node, inner = int(how[0]), how[1]
        if node == _BASE:
            self._base(inner[0], name, told)
        elif node == _NAME:
            self._message(inner, name, depth - 1, told and depth > 0)
        else:
            of, count = inner
            count = count if node == _ARRAY else self._count()
            told = told and (count <= _LONGEST or self.short == "JointState")
            base = of[1][0] if int(of[0]) == _BASE else ""
            if base in _NUMBERS and not told and count:
                size = int(_NUMBERS[base][1])
                self._align(size)
                self.at += count * size
                return
            for i in range(count):
                self._value(of, f"{name}[{i}]", depth, told)

    def _base(self, base: str, name: str, told: bool) -> None:
        if base == "string":
            count = self._count()
            if self.named and (name == "header.frame_id" or name.startswith("name[")):
                self.fixed.append(np.arange(self.at, self.at + count))
                text = self.data[self.at : self.at + count].rstrip(b"\0")
                self.strings[name] = text.decode(errors="replace")
            self.at += count
            return
        kind = _NUMBERS[base]
        size = int(kind[1])
        self._align(size)
        if told or name == "header.stamp.sec":
            self.numbers[name] = self.at, self.order + kind
        self.at += size

    def layout(self, topic: str, wanted: set[str] | None) -> _Layout:
        """What it says of all messages like it.

        Args:
            topic: goes before the names of the series.
            wanted: series that are needed; None for all.
        """
        stamp = self.numbers.pop("header.stamp.sec", None)
        fixed = np.concatenate(self.fixed) if self.fixed else np.empty(0, np.int64)
        taken = [
            (f"{topic}:{name}", place, unit, suggestion)
            for name, place, unit, suggestion in self._series()
            if wanted is None or f"{topic}:{name}" in wanted
        ]
        return _Layout([(n, *p) for n, p, _, _ in taken], [(u, s) for _, _, u, s in taken],
                       stamp, fixed)  # fmt: skip

    def _series(self) -> Iterator[tuple[str, tuple[int, str], str | None, str | None]]:
        """(name, place and type, unit, suggested channel) of each number."""
        if self.short == "JointState":
            for part, (channel, unit) in _JOINT_FIELDS.items():
                i = 0
                while (place := self.numbers.get(f"{part}[{i}]")) and f"name[{i}]" in self.strings:
                    joint = self.strings[f"name[{i}]"]
                    yield f"{part}.{joint}", place, unit, f"{channel}.{joint}"
                    i += 1
        elif self.short in _VECTORS:
            frame = self.strings.get("header.frame_id") or "tool"
            for part, (group, unit) in _VECTORS[self.short].items():
                for axis in ("x", "y", "z"):
                    if place := self.numbers.get(f"{part}.{axis}"):
                        suggestion = f"{group}.{frame}.{axis}" if group else None
                        yield f"{part}.{axis}", place, unit, suggestion
        else:
            for name, place in self.numbers.items():
                yield name, place, None, None


@dataclass(eq=False)
class Topic:
    """Messages of one topic and kind that wait to be taken apart.

    Attributes:
        name: of the topic.
        kind: of message, with its package.
        fields: of that kind and those in it.
        ros1: whether they are written as ROS 1 does, not in CDR.
        data: of each message.
        logged: ns from 1970, of each.
    """

    name: str
    kind: str
    fields: Fields
    ros1: bool = False
    data: list[bytes] = field(default_factory=list)
    logged: list[int] = field(default_factory=list)
    _known: dict[int, list[tuple[_Layout, FloatArray]]] = field(default_factory=dict)

    def numbers(self, log: bool, wanted: set[str] | None) -> Iterator[Numbers]:
        """Take the messages apart by where their numbers stand.

        Args:
            log: the stamp is when it was logged, not the header's.
            wanted: series that are needed; None for all.

        Returns:
            of each series its name, unit and suggested channel, stamps, (m,) ns, and (m,) values.
        """
        sizes = np.array([len(d) for d in self.data])
        logged = np.array(self.logged, dtype=np.int64)
        for size in np.unique(sizes):
            rows = np.flatnonzero(sizes == size)
            parts = self.data if len(rows) == len(sizes) else [self.data[k] for k in rows]
            table = np.frombuffer(b"".join(parts), np.uint8).reshape(len(rows), size)
            for layout, own in self._alike(table, wanted):
                same = table[own]
                stamps = logged[rows[own]]
                if layout.stamp is not None and not log:
                    place, kind = layout.stamp
                    seconds, rest = (
                        _column(same, place + 4 * k, kind[0] + "u4" if k else kind) for k in (0, 1)
                    )
                    stamps = seconds.astype(np.int64) * _NANO + rest.astype(np.int64)
                for (name, place, kind), what in zip(layout.numbers, layout.about, strict=True):
                    yield name, what, stamps, _column(same, place, kind).astype(np.float64)
        self.data, self.logged = [], []

    def _alike(
        self, table: FloatArray, wanted: set[str] | None
    ) -> Iterator[tuple[_Layout, IndexArray]]:
        left = np.arange(len(table))
        known, single = self._known.setdefault(table.shape[1], []), 0
        for layout, fixed in [*known]:
            same = (table[left][:, layout.fixed] == fixed).all(axis=1)
            if same.any():
                yield layout, left[same]
                left = left[~same]
        while left.size:
            first = table[left[0]]
            walk = _Walk(first.tobytes(), self.kind, self.fields, self.ros1)
            layout = walk.layout(self.name, wanted)
            if single > _UNLIKE:
                yield layout, left[:1]
                left = left[1:]
                continue
            fixed = first[layout.fixed]
            same = (table[left][:, layout.fixed] == fixed).all(axis=1)
            yield layout, left[same]
            single += int(same.sum() < 3)
            if len(known) < _UNLIKE:
                known.append((layout, fixed))
            left = left[~same]


@dataclass(eq=False)
class JsonTopic(Topic):
    """Messages of one topic that are objects of JSON."""

    def numbers(self, log: bool, wanted: set[str] | None) -> Iterator[Numbers]:
        """As `Topic`."""
        found: dict[str, Column] = {}
        for one in by_key([json.loads(data) for data in self.data]):
            if isinstance(one, Column):
                found[one.name] = one
            elif one.text:
                warn_user(f"{self.name}: {one.told}")
        stamps = np.array(self.logged, dtype=np.int64)
        for head in () if log else _STAMPS:
            seconds, *rest = (found.get(f"{head}.{part}") for part in ("sec", "nsec", "nanosec"))
            whole = [c.values for c in (seconds, rest[0] or rest[1]) if c and c.kind == "number"]
            if len(whole) == 2 and not any(np.isnan(values).any() for values in whole):
                stamps = whole[0].astype(np.int64) * _NANO + whole[1].astype(np.int64)
                break
        for name, column in found.items():
            own = f"{self.name}:{name}"
            if name.startswith((*_STAMPS, "header.")) or not (wanted is None or own in wanted):
                continue
            if name.endswith(f"[{_LONGEST}]") or column.kind != "number":
                first = str(column.values[0])[:60]
                warn_user(f"{own}: left out: {len(column.values)} values, the first {first!r}")
                continue
            yield own, (None, None), stamps, column.values.astype(np.float64)
        self.data, self.logged = [], []


def _column(table: FloatArray, place: int, kind: str) -> FloatArray:
    size = int(kind[-1])
    return np.ascontiguousarray(table[:, place : place + size]).view(kind)[:, 0]


class Series:
    """Collects the numbers of messages, named "<topic>:<field>".

    `/joint_states:position.joint_1`, `/imu:linear_acceleration.x`, `/wrench:wrench.force.z`; of
    other kinds of message every number, as its fields lead to it. NaN is how a driver says that
    there is no such reading. Times count from the earliest stamp of the first block. A joint that
    some messages of a topic lack keeps its own stamps.

    Args:
        path: the file.
        kind: of file.
        clock: the mapping's `[time]`.
        wanted: series that are needed; None for all.
    """

    def __init__(
        self, path: Path, kind: str, clock: Mapping[str, Any], wanted: set[str] | None = None
    ) -> None:
        self.path, self.kind, self.wanted = path, kind, wanted
        self.log = clock.get("stamp") == "log"
        self._topics: list[Topic] = []
        self._parts: dict[str, list[tuple[IndexArray, FloatArray]]] = {}
        self._about: dict[str, tuple[str | None, str | None]] = {}
        self._begin: int | None = None

    def topic(self, name: str, kind: str, fields: Fields, ros1: bool = False) -> Topic | None:
        """A topic that is collected; None, with a warning, of a kind that is defined nowhere.

        Args:
            name: of the topic.
            kind: of message, with its package.
            fields: of the kinds that are known.
            ros1: whether messages are written as ROS 1 does.
        """
        if self.wanted is not None and not any(w.startswith(f"{name}:") for w in self.wanted):
            return None
        if not _defined(kind, fields):
            warn_user(f"{self.path}: messages of the kind {kind} are defined nowhere and left out")
            return None
        made = Topic(name, kind, fields, ros1)
        self._topics.append(made)
        return made

    def json_topic(self, name: str) -> Topic:
        """A topic of JSON that is collected.

        Args:
            name: of the topic.
        """
        made = JsonTopic(name, "", {})
        self._topics.append(made)
        return made

    @property
    def full(self) -> bool:
        """Whether many messages of a topic wait to be taken apart."""
        return any(len(topic.data) >= AT_ONCE for topic in self._topics)

    def settle(self) -> None:
        """Take apart the messages that wait."""
        for topic in self._topics:
            for name, what, stamps, values in topic.numbers(self.log, self.wanted):
                there = ~np.isnan(values)
                if there.any():
                    own = (stamps, values) if there.all() else (stamps[there], values[there])
                    self._parts.setdefault(name, []).append(own)
                    self._about.setdefault(name, what)

    def block(self) -> RawFile | None:
        """What was collected since the last time; None where it holds no number."""
        self.settle()
        parts, self._parts = self._parts, {}
        if not parts:
            return None
        if self._begin is None:
            self._begin = min(int(t.min()) for own in parts.values() for t, _ in own)
        begin, channels = self._begin, {}
        clocks: dict[tuple[int, ...], tuple[IndexArray, FloatArray]] = {}
        for name, own in parts.items():
            key = tuple(id(ticks) for ticks, _ in own)  # a topic's series share their stamps
            if key not in clocks:
                ticks = np.concatenate([t for t, _ in own])
                order = np.argsort(ticks, kind="stable")
                # Nanoseconds since 1970 do not fit a float: subtract first.
                clocks[key] = order, (ticks[order] - begin) / _NANO
            order, time = clocks[key]
            values = np.concatenate([v for _, v in own])[order]
            channels[name] = RawChannel(name, values, time, *self._about[name])
        taken = datetime.fromtimestamp(begin // _NANO, UTC) if begin > 0 else None
        if taken is not None:
            taken = taken.replace(microsecond=begin % _NANO // 1000)
        return RawFile(self.path, self.kind, channels, taken, begin if begin > 0 else None)


def collected(
    series: Series, fill: Callable[[Series], Iterator[None]], what: tuple[str, str], *, whole: bool
) -> Iterator[RawFile]:
    """The numbers of a log: whole, or in blocks of so many messages that memory does not grow.

    Args:
        series: to collect them.
        fill: gives the log's messages to topics of the series, and stops now and then.
        what: kind of file it is, for people, and the libraries that read it.
        whole: whether one block is wanted.

    Raises:
        InputError: the file is none of its kind, or damaged; no message held a number.
    """
    found = 0
    with library(*what, series.path):
        for _ in fill(series):
            if series.full and whole:
                series.settle()
            elif series.full and (block := series.block()) is not None:
                found += 1
                yield block
        last = series.block()
    if last is not None:
        yield last
    elif not found and series.wanted is None:
        raise InputError("holds no JointState, Imu or WrenchStamped message, nor any other "
                         "with numbers", file=series.path)  # fmt: skip


def _defined(kind: str, fields: Fields) -> bool:
    """Whether a kind of message and all in it are known."""
    if kind not in fields:
        return False
    for _, how in fields[kind][1]:
        while int(how[0]) > _NAME:
            how = how[1][0]
        known = how[1] in fields if int(how[0]) == _NAME else how[1][0] in (*_NUMBERS, "string")
        if not known or (int(how[0]) == _NAME and not _defined(how[1], fields)):
            return False
    return True


def definitions(text: str, kind: str, ros1: bool = False, idl: bool = False) -> Fields:
    """The fields of a kind of message and those in it; ROS's own kinds are known without a text.

    Args:
        text: as a log has it; may be empty.
        kind: with its package.
        ros1: whether ROS 1's own kinds are meant.
        idl: whether the text is IDL.
    """
    from rosbags.typesys import (
        Stores,
        TypesysError,
        get_types_from_idl,
        get_types_from_msg,
        get_typestore,
    )

    known = dict(get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.LATEST).fielddefs)
    try:
        if text:
            known |= get_types_from_idl(text) if idl else get_types_from_msg(text, kind)
    except TypesysError:
        pass  # one that can't be parsed is told with those that are defined nowhere
    return known
