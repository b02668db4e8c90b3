"""A campaign looked through: what is in it, what is wrong with it, how noisy it is."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record
from picchio.core.errors import InputError
from picchio.measurement.noise.estimate import NoiseCollector
from picchio.measurement.noise.level import Noise
from picchio.measurement.noise.window import read_window
from picchio.measurement.quality.check import SEVERITIES, Check, Context, Finding
from picchio.measurement.quality.checks.repeats import Comparison, RepeatsCheck
from picchio.measurement.quality.registry import CHECKS
from picchio.measurement.quality.scan import RecordScan, scan_record
from picchio.robot.flexible_robot import FlexibleRobot

# What is in a campaign: one entry a record, and the campaign as a whole.


@dataclass(frozen=True)
class RecordSummary:
    """One record in numbers.

    Attributes:
        file, kind: as in the campaign.
        samples: how many.
        start, end: s.
        rate: samples a second, Hz.
        pose: rad or m, by joint where it was given so.
        direction: world, unit; None for motion.
        excitation: the blows as programmed, its keys as in `[excitation]`.
        blows: the same in words; None for motion.
        time: when it was taken, ISO 8601.
        temperature: deg C.
        channels: {name: {"unit", "rms" about the mean, "least", "most"}}.
    """

    file: str
    kind: str
    samples: int
    start: float
    end: float
    rate: float
    pose: dict[str, float] | list[float] | None
    direction: list[float] | None
    excitation: dict[str, Any]
    blows: str | None
    time: str | None
    temperature: float | None
    channels: dict[str, dict[str, Any]]

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__}


def summarise(scan: RecordScan) -> RecordSummary:
    """The summary of one record."""
    record, clock = scan.record, scan.clock
    motion = record.kind == "motion"
    blows = scan.window.blows
    words = None
    if not motion:
        words = blows.describe() if blows is not None else "not stated"
        words += f", {record.hits} blows" if record.hits is not None else ", steady"
    direction = record.direction
    return RecordSummary(
        record.file,
        record.kind,
        clock.samples,
        clock.start,
        clock.end,
        clock.rate,
        record.pose,
        None if direction is None else direction.tolist(),
        {} if motion else record.excitation.model_dump(exclude_none=True),
        words,
        record.taken.isoformat() if record.taken is not None else None,
        record.temperature,
        {
            name: {
                "unit": record.channel(name).unit,
                "rms": seen.rms,
                "least": seen.least,
                "most": seen.most,
            }
            for name, seen in scan.channels.items()
        },
    )


FORMAT = "picchio-check/1"


@dataclass(frozen=True, eq=False)
class QualityReport:
    """What `check_campaign` saw.

    Attributes:
        campaign: the campaign.
        robot: its name, where there was one.
        records: in the campaign's order; those that cannot be read are missing.
        findings: the gravest first.
        noise: by channel.
        repeats: records of the same thing against each other.
        checks: {name: what it looks for}.
    """

    campaign: Campaign
    robot: str | None
    records: tuple[RecordSummary, ...]
    findings: tuple[Finding, ...]
    noise: Mapping[str, Noise]
    repeats: tuple[Comparison, ...]
    checks: Mapping[str, str]

    def count(self, severity: str) -> int:
        """How many findings of this severity."""
        return sum(finding.severity == severity for finding in self.findings)

    def to_dict(self) -> dict[str, Any]:
        """`picchio-check/1`, with the provenance of every file."""
        from picchio.core.provenance import provenance

        table = self.campaign.table
        return {
            "format": FORMAT,
            "campaign": None if self.campaign.folder is None else str(self.campaign.folder),
            "robot": self.robot or table.robot,
            "robot_used": self.robot is not None,
            "tool": table.tool,
            "tolerance": table.tolerance.model_dump(),
            "records": [record.to_dict() for record in self.records],
            "findings": [finding.to_dict() for finding in self.findings],
            "counts": {severity: self.count(severity) for severity in SEVERITIES},
            "noise": {name: noise.to_dict() for name, noise in self.noise.items()},
            "repeats": [vars(comparison) for comparison in self.repeats],
            "checks": dict(self.checks),
            "provenance": provenance(self.campaign.files),
        }


def check_campaign(
    campaign: Campaign,
    robot: FlexibleRobot | None = None,
    *,
    keep_going: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> QualityReport:
    """Look a campaign through, record by record, in constant memory.

    Args:
        campaign: its records are read twice: the leading part for the noise, then all of them.
            Clocks are taken however uneven.
        robot: for what needs one (limits, axes, phases).
        keep_going: a record that cannot be read becomes a finding instead of an error.
        progress: called with (done, total) records.

    Raises:
        InputError: a record cannot be read.
    """
    records = [replace(record, clock_tolerance=math.inf) for record in campaign.records]
    campaign = replace(campaign, records=tuple(records))
    findings: list[Finding] = []
    collector = NoiseCollector(campaign)
    readable: list[Record] = []
    total = 2 * len(records)
    for index, record in enumerate(records):
        try:
            collector.add(read_window(record))
            readable.append(record)
        except InputError as error:
            if not keep_going:
                raise
            findings.append(_unreadable(record, error))
        if progress is not None:
            progress(index + 1, total)
    context = Context(campaign, robot, collector.finish(), collector.periods)
    checks: list[Check] = [kind(context) for kind in CHECKS]
    summaries = []
    for index, record in enumerate(readable):
        try:
            scan = scan_record(record)
        except InputError as error:
            if not keep_going:
                raise
            findings.append(_unreadable(record, error))
            continue
        for check in checks:
            findings.extend(check.record(scan))
        summaries.append(summarise(scan))
        if progress is not None:
            progress(len(records) + index + 1, total)
    for check in checks:
        findings.extend(check.finish())
    repeats = next((c.comparisons for c in checks if isinstance(c, RepeatsCheck)), [])
    findings.sort(key=lambda finding: SEVERITIES.index(finding.severity))
    return QualityReport(
        campaign,
        None if robot is None else robot.name,
        tuple(summaries),
        tuple(findings),
        context.noise,
        tuple(repeats),
        {kind.name: kind.what for kind in CHECKS},
    )


def _unreadable(record: Record, error: InputError) -> Finding:
    return Finding("readable", "error", str(error), "mend the file, or leave the record out",
                   record=record.file)  # fmt: skip
