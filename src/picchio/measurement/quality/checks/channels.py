"""Channels and poses: are they there, does the robot know them, are their sizes right?"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from picchio.campaign.channels import AXES, Channel, kinds
from picchio.core.errors import InputError, describe_choices
from picchio.measurement.quality.check import Check, Context, Finding
from picchio.measurement.quality.scan import RecordScan
from picchio.robot.flexible_robot import FlexibleRobot

_FAR = 2.0 * np.pi  # rad: a pose beyond may be in degrees
_SLACK = 1e-3


class ChannelsCheck(Check):
    """Channels that are missing, incomplete, or of nothing that the robot has."""

    name = "channels"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._names: dict[str, dict[str, set[str]]] = defaultdict(dict)

    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """What one record lacks for its purpose, and names that the robot does not know."""
        record, channels = scan.record, scan.window.channels
        self._names[record.kind][record.file] = set(channels)
        present = [channel.kind for channel in channels.values()]
        if record.kind == "percussion" and not any(kind.answers for kind in present):
            choices = dict.fromkeys(kind.name for kind in kinds() if kind.answers)
            yield self.found("no-answer", record.file, choices=", ".join(choices))
        if record.kind == "motion":
            roles = {kind.motion for kind in present}
            if not roles & {"link", "motor"}:
                yield self.found("no-position", record.file)
            if "torque" not in roles and not {"link", "motor"} <= roles:
                yield self.found("no-comparison", record.file)
        for group, members in sorted(scan.window.groups.items()):
            if f"group {group}" not in self.told:
                yield from self._of_group(scan, group, members)
        if self.context.robot is not None:
            yield from self._against_robot(scan, self.context.robot)

    def _of_group(self, scan: RecordScan, group: str, members: list[Channel]) -> Iterator[Finding]:
        kind = members[0].kind
        lacking = [axis for axis in AXES if axis not in {channel.axis for channel in members}]
        if kind.axes and lacking:
            self.told.add(f"group {group}")
            yield self.found("lacking-axes", scan.file, group, axes=" and no ".join(lacking))
        unsaid = [key for key in ("derivative", "plausible") if getattr(kind, key) in (None, ())]
        if kind.answers and unsaid:
            self.told.add(f"group {group}")
            yield self.found("undeclared", channel=group, keys=" and ".join(unsaid))

    def _against_robot(self, scan: RecordScan, robot: FlexibleRobot) -> Iterator[Finding]:
        known = {"joint": robot.joint_names, "frame": robot.tree.links}
        for name, channel in scan.window.channels.items():
            subject, of = channel.subject, channel.kind.of
            if subject is None or f"{of} {subject}" in self.told:
                continue
            if of in known and not _has(robot, of, subject):
                self.told.add(f"{of} {subject}")
                choices = describe_choices(subject, known[of])
                yield self.found("unknown", scan.file, name, robot=robot.name, of=of,
                                 subject=subject, choices=choices)  # fmt: skip
            elif of != "frame" and channel.kind.answers and subject not in robot.flexible_names:
                self.told.add(f"joint {subject}")
                yield self.found("rigid", scan.file, name, subject=subject)

    def finish(self) -> Iterator[Finding]:
        """Channels that some records of a kind have and others have not."""
        for kind, by_file in self._names.items():
            for name in sorted(set().union(*by_file.values())):
                without = [file for file, names in by_file.items() if name not in names]
                if without and len(without) <= len(by_file) / 2:
                    shown = ", ".join(without[:4]) + (" ..." if len(without) > 4 else "")
                    file = without[0] if len(without) == 1 else None
                    yield self.found("missing", file, name, len(without), records=len(by_file),
                                     kind=kind, shown=shown)  # fmt: skip


def _has(robot: FlexibleRobot, of: str, subject: str) -> bool:
    """Whether the robot has a joint or frame."""
    if of == "joint":
        return subject in robot.joint_names
    try:
        robot.link_of(subject)
    except InputError:
        return False
    return True


class UnitsCheck(Check):
    """Sizes that are not plausible in the unit of the header."""

    name = "units"

    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """Every channel of one record; of one that moves, its conditions alone."""
        for name, seen in scan.channels.items():
            channel = scan.window.channels[name]
            kind, group = channel.kind, channel.group
            if not kind.plausible or group in self.told:
                continue
            if scan.record.kind == "motion" and not kind.condition:
                continue
            least, most, guess = kind.plausible[kind.units.index(channel.unit)]
            if not (least <= seen.least and seen.most <= most):
                self.told.add(group)
                size = max(-seen.least, seen.most)
                yield self.found("large", scan.file, name, size, of=channel.unit, guess=guess)


class PosesCheck(Check):
    """Poses: joints that the robot does not have, limits, degrees; directions of length one."""

    name = "poses"

    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """The pose of a percussion record, or the range of a motion."""
        record = scan.record
        if record.kind == "motion":
            yield from self._motion(scan)
            return
        given = record.pose
        if given is None:
            return
        numbers = list(given.values()) if isinstance(given, dict) else list(given)
        largest = max((abs(number) for number in numbers), default=0.0)
        if self.context.robot is not None:
            yield from self._on_robot(scan, self.context.robot, largest > _FAR)
        elif largest > _FAR:
            yield self.found("large", record.file, None, largest)
        length = float(np.linalg.norm(record.table.direction or [1.0, 0.0, 0.0]))
        if abs(length - 1.0) > 1e-2:
            yield self.found("direction", record.file, None, length)

    def _on_robot(self, scan: RecordScan, robot: FlexibleRobot, far: bool) -> Iterator[Finding]:
        given = scan.record.pose
        assert given is not None
        try:
            pose = robot.pose(given)
        except InputError as error:
            yield self.found("misfit", scan.file, robot=robot.name, why=error)
            return
        for joint in robot.limit_violations(pose):
            at = robot.joint_names.index(joint)
            yield self.found("degrees" if far else "limits", scan.file, joint, pose[at],
                             joint=joint, lower=robot.lower[at], upper=robot.upper[at])  # fmt: skip
        if isinstance(given, dict):
            free = [n for n in robot.flexible_names
                    if n not in given and n in robot.joint_names_given]  # fmt: skip
            if free:
                yield self.found("left-out", scan.file, joints=", ".join(free))

    def _motion(self, scan: RecordScan) -> Iterator[Finding]:
        robot = self.context.robot
        for name, channel in scan.window.channels.items():
            if channel.kind.motion not in ("link", "motor"):
                continue
            least, most = scan.channels[name].least, scan.channels[name].most
            size = max(-least, most)
            if robot is None or channel.subject not in robot.joint_names:
                if channel.unit == "rad" and size > 4.0 * _FAR:
                    yield self.found("far", scan.file, name, most=size)
                continue
            at = robot.joint_names.index(channel.subject)
            lower, upper = robot.lower[at], robot.upper[at]
            beyond = max(lower - least, most - upper)
            if beyond > _SLACK:
                yield self.found("range", scan.file, name, beyond, of=channel.unit, least=least,
                                 most=most, lower=lower, upper=upper)  # fmt: skip
