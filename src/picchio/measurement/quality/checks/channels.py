"""Which channels are there, does the robot know their joints and frames, are their sizes right?"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

from picchio.campaign.channels import AXES, Channel, kinds
from picchio.core.errors import InputError, describe_choices
from picchio.measurement.quality.check import Check, Context, Finding
from picchio.measurement.quality.scan import RecordScan


class ChannelsCheck(Check):
    """Channels that are missing, incomplete, or of nothing that the robot has."""

    name = "channels"
    what = "channels present in every record, joints and frames that the robot has"

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
            yield self.found("error", "no channel shows how the robot answered",
                             f"record one of {', '.join(choices)}",
                             record=record.file)  # fmt: skip
        if record.kind == "motion":
            roles = {kind.motion for kind in present}
            if not roles & {"link", "motor"}:
                yield self.found("error", "no channel shows where the joints are",
                                 "record position.<joint> or motor_position.<joint>",
                                 record=record.file)  # fmt: skip
            if "torque" not in roles and not {"link", "motor"} <= roles:
                yield self.found("warning", "there is neither a torque nor a second encoder "
                                 "to compare a model with",
                                 "record torque.<joint> (motor current times its constant)",
                                 record=record.file)  # fmt: skip
        for group, members in sorted(scan.window.groups.items()):
            if f"group {group}" not in self.told:
                yield from self._of_group(scan, group, members)
        yield from self._against_robot(scan)

    def _of_group(self, scan: RecordScan, group: str, members: list[Channel]) -> Iterator[Finding]:
        kind = members[0].kind
        lacking = [axis for axis in AXES if axis not in {channel.axis for channel in members}]
        if kind.axes and lacking:
            self.told.add(f"group {group}")
            yield self.found("note", f"has no {' and no '.join(lacking)} axis",
                             "three axes tell more about directions than one",
                             record=scan.file, channel=group)  # fmt: skip
        unsaid = [key for key in ("derivative", "plausible") if getattr(kind, key) in (None, ())]
        if kind.answers and unsaid:
            self.told.add(f"group {group}")
            yield self.found("note", "its axes, its phase or its size are not checked: its kind "
                             f"does not declare {' and '.join(unsaid)}",
                             "declare them in its ChannelKind", channel=group)  # fmt: skip

    def _against_robot(self, scan: RecordScan) -> Iterator[Finding]:
        robot = self.context.robot
        if robot is None:
            return
        for name, channel in scan.window.channels.items():
            subject = channel.subject
            if subject is None or f"{channel.kind.of} {subject}" in self.told:
                continue
            if channel.kind.of == "joint" and subject not in robot.joint_names:
                self.told.add(f"joint {subject}")
                yield self.found("error", f"{robot.name} has no joint {subject!r}; "
                                 + describe_choices(subject, robot.joint_names),
                                 record=scan.file, channel=name)  # fmt: skip
            elif channel.kind.of == "frame":
                try:
                    robot.link_of(subject)
                except InputError:
                    self.told.add(f"frame {subject}")
                    yield self.found("error", f"{robot.name} has no frame {subject!r}; "
                                     + describe_choices(subject, robot.tree.links),
                                     record=scan.file, channel=name)  # fmt: skip
            elif channel.kind.answers and subject not in robot.flexible_names:
                self.told.add(f"joint {subject}")
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


class UnitsCheck(Check):
    """Sizes that are not plausible in the unit of the header."""

    name = "units"
    what = "sizes plausible in the header's unit"

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
            if least <= seen.least and seen.most <= most:
                continue
            self.told.add(group)
            size = max(-seen.least, seen.most)
            yield self.found(
                "warning", f"reaches {size:.4g} {channel.unit}, which no arm survives",
                f"is the header's unit right? {guess}",
                record=scan.file, channel=name, value=size, unit=channel.unit,
            )  # fmt: skip
