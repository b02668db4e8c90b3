"""Which channels are there, and does the robot know their joints and frames?"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

from picchio.campaign.channels import AXES, ChannelKind
from picchio.campaign.channels import kinds as known_kinds
from picchio.core.errors import InputError, describe_choices
from picchio.measurement.quality.check import Check, Context, Finding
from picchio.measurement.quality.scan import RecordScan


def _answers(kind: ChannelKind) -> bool:
    """Whether it shows how the robot answers to the tool."""
    return kind.reader is not None and not kind.of_force


class ChannelsCheck(Check):
    """Channels that are missing, incomplete, or of nothing that the robot has."""

    name = "channels"
    what = "channels present in every record, joints and frames that the robot has"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._names: dict[str, dict[str, set[str]]] = defaultdict(dict)
        self._told: set[str] = set()

    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """What one record lacks for its purpose, and names that the robot does not know."""
        record = scan.record
        names = set(record.channels)
        self._names[record.kind][record.file] = names
        kinds = {record.channel(name).kind.name for name in names}
        if record.kind == "percussion" and not any(
            _answers(record.channel(name).kind) for name in names
        ):
            choices = dict.fromkeys(kind.name for kind in known_kinds() if _answers(kind))
            yield self.found("error", "no channel shows how the robot answered",
                             f"record one of {', '.join(choices)}",
                             record=record.file)  # fmt: skip
        if record.kind == "motion":
            if not kinds & {"position", "motor_position"}:
                yield self.found("error", "no channel shows where the joints are",
                                 "record position.<joint> or motor_position.<joint>",
                                 record=record.file)  # fmt: skip
            if "torque" not in kinds and not {"position", "motor_position"} <= kinds:
                yield self.found("warning", "there is neither a torque nor a second encoder "
                                 "to compare a model with",
                                 "record torque.<joint> (motor current times its constant)",
                                 record=record.file)  # fmt: skip
        for group in sorted({record.channel(n).group for n in names if record.channel(n).axis}):
            lacking = [axis for axis in AXES if f"{group}.{axis}" not in names]
            if lacking and f"axes {group}" not in self._told:
                self._told.add(f"axes {group}")
                yield self.found("note", f"has no {' and no '.join(lacking)} axis",
                                 "three axes tell more about directions than one",
                                 record=record.file, channel=group)  # fmt: skip
        yield from self._against_robot(scan)

    def _against_robot(self, scan: RecordScan) -> Iterator[Finding]:
        robot = self.context.robot
        if robot is None:
            return
        for name in scan.record.channels:
            channel = scan.record.channel(name)
            subject = channel.subject
            if subject is None or f"{channel.kind.of} {subject}" in self._told:
                continue
            if channel.kind.of == "joint" and subject not in robot.joint_names:
                self._told.add(f"joint {subject}")
                yield self.found("error", f"{robot.name} has no joint {subject!r}; "
                                 + describe_choices(subject, robot.joint_names),
                                 record=scan.file, channel=name)  # fmt: skip
            elif channel.kind.of == "frame":
                try:
                    robot.link_of(subject)
                except InputError:
                    self._told.add(f"frame {subject}")
                    yield self.found("error", f"{robot.name} has no frame {subject!r}; "
                                     + describe_choices(subject, robot.tree.links),
                                     record=scan.file, channel=name)  # fmt: skip
            elif channel.kind.name == "deflection" and subject not in robot.flexible_names:
                self._told.add(f"joint {subject}")
                yield self.found("warning", f"{subject} has no stiffness in the model, so that it "
                                 "cannot deflect", "give its stiffness in a sidecar (--flex)",
                                 record=scan.file, channel=name)  # fmt: skip

    def finish(self) -> Iterator[Finding]:
        """Channels that some records of a kind have and others have not."""
        for kind, by_file in self._names.items():
            every = set().union(*by_file.values())
            for name in sorted(every):
                without = [file for file, names in by_file.items() if name not in names]
                if without and len(without) <= len(by_file) / 2:
                    shown = ", ".join(without[:4]) + (" ..." if len(without) > 4 else "")
                    yield self.found(
                        "note",
                        f"missing in {len(without)} of {len(by_file)} {kind} records: {shown}",
                        "allowed; was the sensor unplugged, or the name misspelt?",
                        record=without[0] if len(without) == 1 else None, channel=name,
                        value=float(len(without)), unit="records",
                    )  # fmt: skip
