"""Can the robot reach the campaign's poses, and are they in radians?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from picchio.core.errors import InputError
from picchio.measurement.quality.check import Check, Finding
from picchio.measurement.quality.scan import RecordScan

_FAR = 2.0 * np.pi
_SLACK = 1e-3


class PosesCheck(Check):
    """Poses: joints that the robot does not have, limits, degrees; directions of length one."""

    name = "poses"
    what = "poses and motions within the robot's limits, in radians; directions"

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
        degrees = "the pose may be in degrees: it must be in radians" if largest > _FAR else ""
        robot = self.context.robot
        if robot is None:
            if degrees:
                yield self.found("warning", f"a joint is at {largest:.4g} rad", degrees,
                                 record=record.file, value=largest, unit="rad")  # fmt: skip
        else:
            yield from self._on_robot(scan, degrees)
        length = float(np.linalg.norm(record.table.direction or [1.0, 0.0, 0.0]))
        if abs(length - 1.0) > 1e-2:
            yield self.found("note", f"the direction has length {length:.4g}; it is taken as a "
                             "unit vector", "give the force's size as `force`",
                             record=record.file, value=length)  # fmt: skip

    def _on_robot(self, scan: RecordScan, degrees: str) -> Iterator[Finding]:
        robot, given = self.context.robot, scan.record.pose
        assert robot is not None and given is not None
        try:
            pose = robot.pose(given)
        except InputError as error:
            yield self.found("error", f"the pose does not fit {robot.name}: {error}",
                             record=scan.file)  # fmt: skip
            return
        for joint in robot.limit_violations(pose):
            at = robot.joint_names.index(joint)
            yield self.found(
                "warning",
                f"{joint} stands at {pose[at]:.4g}, beyond its limits "
                f"{robot.lower[at]:.4g} to {robot.upper[at]:.4g}",
                degrees or "check the pose, its sign and its zero",
                record=scan.file, channel=joint, value=float(pose[at]), unit="rad",
            )  # fmt: skip
        if isinstance(given, dict):
            free = [name for name in robot.flexible_names
                    if name not in given and name in robot.joint_names_given]  # fmt: skip
            if free:
                yield self.found("note", f"the pose leaves out {', '.join(free)}: taken as zero",
                                 record=scan.file)  # fmt: skip

    def _motion(self, scan: RecordScan) -> Iterator[Finding]:
        robot = self.context.robot
        for name, channel in scan.window.channels.items():
            if channel.kind.motion not in ("link", "motor"):
                continue
            seen = scan.channels[name]
            if robot is None or channel.subject not in robot.joint_names:
                if channel.unit == "rad" and max(-seen.least, seen.most) > 4.0 * _FAR:
                    yield self.found("warning", f"reaches {max(-seen.least, seen.most):.4g} rad",
                                     "is it in degrees? the header must say so",
                                     record=scan.file, channel=name)  # fmt: skip
                continue
            at = robot.joint_names.index(channel.subject)
            below, above = robot.lower[at] - seen.least, seen.most - robot.upper[at]
            beyond = max(below, above)
            if beyond > _SLACK:
                yield self.found(
                    "warning",
                    f"goes from {seen.least:.4g} to {seen.most:.4g}, beyond its limits "
                    f"{robot.lower[at]:.4g} to {robot.upper[at]:.4g}",
                    "check the unit, the sign and the zero of the encoder",
                    record=scan.file, channel=name, value=float(beyond), unit=channel.unit,
                )  # fmt: skip
