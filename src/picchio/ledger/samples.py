"""From a log and its mapping to stamped samples: what may be a blow, and where the robot stands."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from picchio.campaign.channels import AXES, LOG_KINDS, Channel, kinds, parse_channel
from picchio.campaign.importing import detect
from picchio.campaign.importing.aligned import aligned
from picchio.campaign.importing.importer import beside, called, combined, kind_of, read_blocks
from picchio.campaign.importing.mapping import JoinTable, Mapping, TimeTable
from picchio.campaign.importing.named import named
from picchio.campaign.importing.raw import RawChannel, RawFile
from picchio.campaign.importing.resample import clocked, taken_samples
from picchio.core.arrays import FloatArray, IndexArray
from picchio.core.errors import InputError
from picchio.core.units import Conversion
from picchio.robot.flexible_robot import FlexibleRobot

KINDS = ("force", "acceleration", "trigger", "poses")
"""What blows are told by, the surest first."""
BLOCK = 1 << 16
"""Samples that are held at a time of a log that can be read in blocks."""
_OWN_CLOCKS = ("mcap", "bag")  # a topic may have no message for a while
FIXED = "a robot that never moves: [blows] pose"
STEPS = 5.0
"""Of the usual step: a longer one is a gap."""


@dataclass(frozen=True, eq=False)
class Samples:
    """A stretch of a log.

    Attributes:
        kind: one of `KINDS`.
        stamps: (m,) int64 ns from 1970, ascending.
        values: (m, k): force N (k = 1 along a direction, 3 with axes), acceleration m/s^2 (1 to
            3), trigger (1), or nothing to see (0).
        pose_stamps: (p,) int64 ns, ascending.
        poses: (p, nv) rad or m.
        others: further channels by name: (stamps, values).
        detected: what was found out about the file.
        names: k channels, of which the values are.
    """

    kind: str
    stamps: IndexArray
    values: FloatArray
    pose_stamps: IndexArray
    poses: FloatArray
    others: dict[str, tuple[IndexArray, FloatArray]] = field(default_factory=dict)
    detected: tuple[str, ...] = ()
    names: tuple[str, ...] = ()

    def between(self, first: int, last: int) -> Samples:
        """The part of it that lies in an interval, both ends included.

        Args:
            first: ns.
            last: ns.
        """
        own = (self.stamps >= first) & (self.stamps <= last)
        pose = (self.pose_stamps >= first) & (self.pose_stamps <= last)
        return replace(self, stamps=self.stamps[own], values=self.values[own],
                       pose_stamps=self.pose_stamps[pose], poses=self.poses[pose])  # fmt: skip

    def standing_as(self, before: Samples | None) -> Samples:
        """The stretch with the last pose of the one before it, which holds until its own first.

        Args:
            before: of the same log, if there is one.
        """
        if before is None or (before.pose_stamps[-1:] > self.pose_stamps[:1]).any():
            return self
        return replace(self, pose_stamps=np.append(before.pose_stamps[-1:], self.pose_stamps),
                       poses=np.vstack([before.poses[-1:], self.poses]))  # fmt: skip

    @property
    def usual_step(self) -> int:
        """ns, from one sample to the next, to two digits; 0 where it cannot be said."""
        stamps = self.stamps if self.stamps.size > 1 else self.pose_stamps
        if stamps.size < 2:
            return 0
        return int(float(f"{float(np.median(np.diff(stamps))):.1e}"))

    @property
    def gap(self) -> int:
        """ns: longer steps than this are gaps."""
        return int(STEPS * self.usual_step)


def read_samples(
    path: Path, mapping: Mapping, robot: FlexibleRobot, size: int = BLOCK
) -> Iterator[Samples]:
    """A log in stretches, in bounded memory where its kind of file allows: see `read_blocks`.

    Args:
        path: the file.
        mapping: which series become which channels.
        robot: whose joints the poses are of.
        size: samples that are held at a time.

    Raises:
        InputError: the file can't be read, the mapping does not fit it or the robot, or nothing
            says when it was recorded.
    """
    plan = _Plan(mapping, robot, kind_of(path, mapping))
    blocks = _dated(read_blocks(path, mapping, plan.needed, size), mapping.time, plan.series)
    if plan.apart:
        joins = [_joined(path, mapping, table, size) for table in mapping.join]
        # The first stretch says what the log's step is; a topic may begin later than others.
        blow = plan.seen.get(plan.kind, ())
        blocks = aligned([blocks, *joins], {s: 1 + (s in blow) for s in plan.series})
    for raw in blocks:
        yield plan.samples(raw)
    plan.require_all(path)


def _dated(
    blocks: Iterator[RawFile], asked: TimeTable, names: set[str] | None, key: str = "time.start"
) -> Iterator[RawFile]:
    """The blocks with the clock that the first one shows: the others must not differ."""
    for raw in blocks:
        made = clocked(raw, asked, None, names and names & set(raw.channels))
        if made.epoch is None:
            raise InputError(
                "nothing says when this log was recorded, so that its blows cannot be told from "
                "another log's", file=raw.path, key=key,
                hint="give [time] start in the mapping, or stamps with a date",
            )  # fmt: skip
        yield made
        if asked.series is None and asked.rate is None:
            asked = _fixed(raw, asked)


def _joined(path: Path, mapping: Mapping, table: JoinTable, size: int) -> Iterator[RawFile]:
    """The blocks of a joined file."""
    file, rules = beside(path, mapping, table)
    names = {entry.series for entry in rules.channel}
    needed = names | ({table.time.series} if table.time.series else set())
    blocks = read_blocks(file, rules, needed, size)
    for raw in _dated(blocks, table.time, names, "join.time.start"):
        yield called(raw, table.name, table.shift)


def by_names(path: Path, robot: FlexibleRobot) -> tuple[Mapping | None, tuple[str, ...]]:
    """A mapping for logs whose series are named as channels or as the robot's joints.

    Args:
        path: one of the logs.
        robot: whose it is.

    Returns:
        the mapping, None where no blow and no pose would be told by it; what was taken for what,
        a sentence each.

    Raises:
        InputError: the file can't be read.
    """
    raw = next(read_blocks(path, None, None, BLOCK), None)
    if raw is None:
        raise InputError("is empty", file=path)
    found = named(raw, robot.joint_names, [*robot.tree.links, *robot.tree.joints])
    taken = [one for one in found if one.to]
    lines = [f"{one.series} is {one.to}: {one.why}" for one in taken]
    left = [one.series for one in found if not one.to]
    if left:
        lines.append(f"not used: {', '.join(left)}")
    if not any(one.to.startswith("position.") for one in taken):
        return None, tuple(lines)
    return Mapping(channel=[one.entry for one in taken]), tuple(lines)


def _fixed(raw: RawFile, asked: TimeTable) -> TimeTable:
    """`[time]` with the series and unit that are its clock."""
    if all(channel.time is not None for channel in raw.channels.values()):
        return asked
    found = detect.require(detect.clock(raw), raw)
    return asked.model_copy(update={"series": found.series, "unit": found.unit})


class _Plan:
    """What the series of a mapping are for."""

    def __init__(self, mapping: Mapping, robot: FlexibleRobot, kind: str) -> None:
        self.mapping, self.robot = mapping, robot
        self.apart = kind in _OWN_CLOCKS or bool(mapping.join)  # series have their own clocks
        self.series = {s for _, _, parts, _ in mapping.entries for s in parts}
        self.series |= {entry.series for entry in mapping.filter}
        self.needed = self.series | ({mapping.time.series} if mapping.time.series else set())
        self.zero: int | None = None
        self.met: set[str] = set()
        self.last: dict[str, tuple[IndexArray, FloatArray]] = {}
        self.before: dict[str, tuple[int, float]] = {}
        self.seen: dict[str, list[str]] = {}
        names, joints = robot.joint_names, dict[str, str]()
        for key, to, _, entry in mapping.entries:
            if entry.remove is not None:
                raise InputError("a log has no rest to take a mean of; give an offset",
                                 key=f"{key}.remove", value=entry.remove)  # fmt: skip
            word, _, rest = to.partition(".")
            if word in ("position", "motor_position") and rest not in ("x", "y", "z"):
                if rest not in names:
                    raise InputError("the robot has no such joint", key=key, value=rest,
                                     choices=names)  # fmt: skip
                # The motor side where both are logged: the link side swings under the blows.
                if word == "motor_position" or rest not in joints:
                    joints.pop(rest, None)
                    joints[rest] = to
            elif word in ("force", "trigger"):
                self.seen.setdefault(word, []).append(to)
            elif word in ("accelerometer", "acceleration") and self._at_tool(key, rest):
                self.seen.setdefault("acceleration", []).append(to)
        self.poses = {to: names.index(joint) for joint, to in joints.items()}
        for kind, found in self.seen.items():
            sensor = max(to.rpartition(".")[0] for to in found)  # one is enough
            self.seen[kind] = sorted(to for to in found if to.rpartition(".")[0] == sensor)
        fixed = mapping.blows.pose if mapping.blows else None
        if fixed is not None and len(fixed) != len(names):
            raise InputError("must have a number for each joint", key="blows.pose", value=fixed,
                             choices=names)  # fmt: skip
        self.fixed = None if fixed is None else np.array(fixed)
        self.kind = next((kind for kind in KINDS if self.seen.get(kind)), "poses")
        if self.kind == "poses" and not self.poses:
            raise InputError("maps no force, acceleration, trigger or position, so that nothing "
                             "can be counted", key="channel")  # fmt: skip
        if not self.poses and self.fixed is None:
            raise InputError("no position was logged, so that nobody knows where the robot stood",
                             key="channel", hint=FIXED)  # fmt: skip

    def _at_tool(self, key: str, rest: str) -> bool:
        """Whether an acceleration is that of the link that carries the tool."""
        try:
            link = self.robot.link_of(rest.rpartition(".")[0])
        except InputError as error:
            raise error.placed(key=key) from None
        return link == self.robot.link_of(self.robot.tool_frame)

    def samples(self, raw: RawFile) -> Samples:
        assert raw.epoch is not None
        filtered = self._filtered(raw) if self.apart else raw
        values: dict[str, tuple[IndexArray, FloatArray]] = {}
        asked = self._window(raw.epoch)
        self.met |= raw.channels.keys()
        for key, to, parts, entry in self.mapping.entries:
            if self.apart and not parts.keys() <= raw.channels.keys():
                continue  # no message of this topic in this stretch
            series = {s: raw.channel(s, key=key) for s in parts}
            first = next(iter(series.values()))
            assert first.time is not None
            channel, convert = _channel(to, entry.unit or first.unit)
            stored = combined({s: c.values for s, c in series.items()}, parts)
            stored = entry.sign * (entry.scale * stored.astype(np.float64) + entry.offset)
            take = taken_samples(filtered, first, asked, self.mapping.filter, None)
            stamps = raw.epoch + np.rint(first.time * 1e9).astype(np.int64)
            values[channel.name] = (stamps[take], convert(stored)[take])
        names = tuple(self.seen.get(self.kind, ()))
        stamps, table = self._together(names, values)
        if self.kind == "force" and "force" not in names:  # an axis that is not logged has none
            whole = np.zeros((len(table), len(AXES)))
            whole[:, [AXES.index(n[-1]) for n in names]] = table
            table = whole
        at, rows = self._together(tuple(self.poses), values)
        self.last |= {n: (s[-1:], v[-1:]) for n, (s, v) in values.items() if s.size}
        if self.fixed is not None and not self.poses:
            at, rows = stamps[:1], np.empty((len(stamps[:1]), 0))
        poses = np.zeros((at.size, len(self.robot.joint_names)))
        poses += 0.0 if self.fixed is None else self.fixed
        poses[:, list(self.poses.values())] = rows
        used = {*names, *self.poses}
        others = {n: v for n, v in values.items() if n not in used}
        return Samples(self.kind, stamps, table, at, poses, others, raw.detected, names)

    def _filtered(self, raw: RawFile) -> RawFile:
        """The block with what filters look at as it was last before: it holds until the next."""
        channels, epoch = dict(raw.channels), raw.epoch or 0
        for series in {entry.series for entry in self.mapping.filter}:
            stamp, value = self.before.get(series, (-(2**62), np.nan))
            nothing = RawChannel(series, np.empty(0), np.empty(0))
            own = channels.get(series, nothing)
            assert own.time is not None
            when, what = own.time[-1:], own.values[-1:]
            for time, size in zip(when, what, strict=True):
                self.before[series] = epoch + round(float(time) * 1e9), size
            channels[series] = replace(own, time=np.append((stamp - epoch) * 1e-9, own.time),
                                       values=np.append(value, own.values))  # fmt: skip
        return replace(raw, channels=channels)

    def _window(self, epoch: int) -> TimeTable:
        """`[time]` with begin and end in s of this stretch, not of the file."""
        self.zero = epoch if self.zero is None else self.zero
        asked, late = self.mapping.time, (epoch - self.zero) * 1e-9
        moved = {k: v - late for k in ("begin", "end") if isinstance(v := getattr(asked, k), float)}
        return asked.model_copy(update=moved)

    def _together(
        self, names: tuple[str, ...], values: dict[str, tuple[IndexArray, FloatArray]]
    ) -> tuple[IndexArray, FloatArray]:
        """Channels on the stamps of the first; others hold their last sample until the next."""
        nothing = np.empty(0, np.int64), np.empty((0, max(len(names), 1)))
        if not names or names[0] not in values:
            return nothing
        clock, columns = values[names[0]][0], []
        for name in names:
            own, column = values.get(name, (clock[:0], np.empty(0)))
            if own.size != clock.size or (own != clock).any():
                if name in self.last:  # from the stretch before
                    before = self.last[name]
                    own = np.concatenate([before[0], own])
                    column = np.concatenate([before[1], column])
                if not own.size:
                    return nothing
                at = np.maximum(np.searchsorted(own, clock, side="right") - 1, 0)
                column = column[at]
            columns.append(column)
        return clock, np.column_stack(columns)

    def require_all(self, path: Path) -> None:
        """Raise where a series that the mapping names was nowhere in the file."""
        named = [(key, series) for key, _, parts, _ in self.mapping.entries for series in parts]
        named += [(f"filter[{i}].series", f.series) for i, f in enumerate(self.mapping.filter)]
        for key, series in named:
            if series not in self.met:
                first = next(read_blocks(path, self.mapping, None, BLOCK), None)
                raise InputError(f"{path.name} has no such series", key=key, value=series,
                                 choices=first.channels if first else ())  # fmt: skip


def _channel(name: str, unit: str | None) -> tuple[Channel, Conversion]:
    return parse_channel(name, unit, (*LOG_KINDS, *kinds()))
