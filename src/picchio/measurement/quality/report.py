"""A campaign looked through: what is in it, what is wrong with it, how noisy it is."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, TypeVar

import numpy as np

from picchio.campaign.campaign import Campaign, load_campaign
from picchio.campaign.record import Record
from picchio.core.errors import InputError
from picchio.core.html import sheet
from picchio.core.processes import one_thread
from picchio.core.results import TableResult
from picchio.measurement.noise.estimate import NoiseCollector
from picchio.measurement.noise.level import Noise
from picchio.measurement.noise.window import read_window
from picchio.measurement.quality.check import SEVERITIES, Check, Context, Finding, catalogue
from picchio.measurement.quality.checks import CHECKS
from picchio.measurement.quality.checks.repeats import Comparison, RepeatsCheck
from picchio.measurement.quality.scan import RecordScan, scan_record
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.loading.load import load_robot
from picchio.robot.loading.objects import RobotLike

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
        return dict(vars(self))


def summarise(scan: RecordScan) -> RecordSummary:
    """The summary of one record."""
    record, clock = scan.record, scan.clock
    motion = record.kind == "motion"
    blows = scan.window.blows
    words = blows.describe() if blows is not None else "not stated"
    words += ", steady" if record.steady else f", {record.hits} blows"
    if record.reads_force:
        words = "the force was recorded"
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
        None if motion else words,
        record.taken.isoformat() if record.taken is not None else None,
        record.temperature,
        {
            name: {"unit": record.channel(name).unit}
            | {word: getattr(seen, word) for word in ("rms", "least", "most")}
            for name, seen in scan.channels.items()
        },
    )


FORMAT = "picchio-check/1"
_NUMBER = re.compile(r"[-+]?\d[\d.]*(e[-+]?\d+)?")
T = TypeVar("T")


@dataclass(frozen=True, eq=False, repr=False)
class QualityReport(TableResult):
    """What `check` saw; its table is the findings.

    Attributes:
        campaign: the campaign.
        robot: what the records were checked against, where there was one.
        records: in the campaign's order; those that cannot be read are missing.
        findings: the gravest first.
        noise: by channel.
        repeats: records of the same thing against each other.
        checks: {name: what it looks for}.
    """

    LACKS: ClassVar = {
        "plot": "findings are sentences; `picchio.report` draws the records behind them",
        "show": "findings have no place in space",
    }

    INDEX = ""
    PAGE = "visuals.report.residual:check_page"

    campaign: Campaign
    robot: FlexibleRobot | None
    records: tuple[RecordSummary, ...]
    findings: tuple[Finding, ...]
    noise: Mapping[str, Noise]
    repeats: tuple[Comparison, ...]
    checks: Mapping[str, str]

    def count(self, severity: str) -> int:
        """How many findings of this severity.

        Args:
            severity: "error", "warning" or "note".
        """
        return sum(finding.severity == severity for finding in self.findings)

    def groups(self) -> list[list[Finding]]:
        """The findings, those of the same thing in several records together, the worst first."""
        groups: dict[tuple[str, ...], list[Finding]] = {}
        for finding in self.findings:
            pattern = _NUMBER.sub("#", finding.message)
            channel = re.sub(r"\.[xyz]$", "", finding.channel or "")
            if finding.check == "length":
                channel = ""
            key = (finding.check, finding.severity, channel, pattern)
            groups.setdefault(key, []).append(finding)
        return [sorted(g, key=lambda f: -abs(f.value or 0.0)) for g in groups.values()]

    def signal_to_noise(self, channel: str) -> float:
        """A channel's RMS over all records against its noise, dB; NaN where that is not known.

        Args:
            channel: its name.
        """
        noise = self.noise.get(channel)
        rms = [r.channels[channel]["rms"] for r in self.records if channel in r.channels]
        size = float(np.sqrt(np.mean(np.square(rms))))
        if noise is None or noise.std <= 0.0 or size <= 0.0:
            return math.nan
        return 20.0 * math.log10(size / noise.std)

    def _headline(self) -> str:
        counts = [(self.count(severity), severity) for severity in SEVERITIES]
        told = ", ".join(f"{n} {word}{'' if n == 1 else 's'}" for n, word in counts if n)
        return f"{len(self.records)} records, {told or 'nothing found'}"

    def _rows(self) -> list[dict[str, Any]]:
        return [finding.to_dict() for finding in self.findings]

    def _repr_html_(self) -> str:
        rows = [(f.severity, f.record, f.channel, f.message, f.advice) for f in self.findings]
        columns = ("", "record", "channel", "what was seen", "what to do")
        return sheet(f"Check of {self._headline()}", None, columns, rows)

    def _content(self) -> dict[str, Any]:
        from picchio.core.provenance import provenance

        table = self.campaign.table
        return {
            "format": FORMAT,
            "campaign": self.campaign.folder,
            "robot": table.robot if self.robot is None else self.robot.name,
            "robot_used": self.robot is not None,
            "tool": table.tool,
            "tolerance": table.tolerance.model_dump(),
            "records": [record.to_dict() for record in self.records],
            "findings": self._rows(),
            "counts": {severity: self.count(severity) for severity in SEVERITIES},
            "noise": {name: noise.to_dict() for name, noise in self.noise.items()},
            "repeats": [vars(comparison) for comparison in self.repeats],
            "checks": self.checks,
            "provenance": provenance(self.campaign.files),
        }


@one_thread()
def check(
    campaign: str | Path | Campaign,
    robot: RobotLike | None = None,
    *,
    flex: str | Path | None = None,
    tool: str | None = None,
    reducers: Sequence[str | Path] = (),
    use_robot: bool = True,
    keep_going: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> QualityReport:
    """Check measured data: what is in a campaign, and what is wrong with it.

    Clipping, dropouts, spikes, drift, uneven clocks, swapped or flipped axes, hum, high-passes,
    delays, records that are too short, aliasing, repeats, and the noise of every channel. Records
    are read twice and one at a time, in constant memory. Clocks are taken however uneven.

    Args:
        campaign: the measured data, or their folder.
        robot: for what needs one (limits, axes, phases); the campaign's own if None. If the
            campaign's own cannot be loaded, that is a finding.
        flex: sidecar of the robot.
        tool: the frame that carries the tool; as the campaign says if None.
        reducers: catalogues of reducers, as in `load_robot`.
        use_robot: False leaves out what needs a robot.
        keep_going: a record that cannot be read becomes a finding instead of an error.
        progress: called with (done, total) records.

    Returns:
        the findings, the gravest first, with a summary of every record and the noise of every
        channel.

    Raises:
        InputError: a campaign, a robot or a record that cannot be read.
    """
    campaign = load_campaign(campaign, clock_tolerance=math.inf).of_work("a check of measured data")
    found, problem = _robot(campaign, robot, flex, tool, reducers) if use_robot else (None, None)
    records = [replace(record, clock_tolerance=math.inf) for record in campaign.records]
    campaign = replace(campaign, records=tuple(records))
    findings: list[Finding] = []

    def tried(read: Callable[[Record], T], record: Record) -> T | None:
        try:
            return read(record)
        except InputError as error:
            if not keep_going:
                raise
            advice = "mend the file, or leave the record out"
            findings.append(Finding("readable", "error", str(error), advice, record=record.file))
            return None

    collector = NoiseCollector(campaign)
    readable: list[Record] = []
    say = progress or (lambda done, total: None)
    total = 2 * len(records)
    for index, record in enumerate(records):
        window = tried(read_window, record)
        if window is not None:
            collector.add(window)
            readable.append(record)
        say(index + 1, total)
    context = Context(campaign, found, collector.finish(), collector.periods)
    checkers: list[Check] = [kind(context) for kind in CHECKS]
    summaries = []
    for index, record in enumerate(readable):
        scan = tried(scan_record, record)
        if scan is None:
            continue
        for checker in checkers:
            if checker.of in ("", record.kind):
                findings.extend(checker.record(scan))
        summaries.append(summarise(scan))
        say(len(records) + index + 1, total)
    for checker in checkers:
        findings.extend(checker.finish())
    repeats = next((c.comparisons for c in checkers if isinstance(c, RepeatsCheck)), [])
    findings.sort(key=lambda finding: SEVERITIES.index(finding.severity))
    if problem is not None:
        findings.insert(0, problem)
    return QualityReport(
        campaign,
        found,
        tuple(summaries),
        tuple(findings),
        context.noise,
        tuple(repeats),
        {kind.name: catalogue()[kind.name]["what"] for kind in CHECKS},
    )


def _robot(
    campaign: Campaign,
    robot: RobotLike | None,
    flex: str | Path | None,
    tool: str | None,
    reducers: Sequence[str | Path],
) -> tuple[FlexibleRobot | None, Finding | None]:
    """The robot asked for, or else the campaign's; what is wrong with the campaign's own."""
    if isinstance(robot, FlexibleRobot):
        return load_robot(robot, flex=flex, tool=tool, reducers=reducers), None
    name = robot or campaign.robot
    if name is None:
        for key, value in (("flex", flex), ("tool", tool), ("reducers", reducers)):
            if value:
                raise InputError("needs a robot", key=key, value=str(value))
        return None, None
    try:
        found = load_robot(name, flex=flex, tool=tool or campaign.tool, reducers=reducers)
        return found, None
    except InputError as error:
        if robot is not None or flex is not None or tool is not None or reducers:
            raise
        return None, Finding(
            "robot",
            "error",
            f"the campaign's robot cannot be used: {error}",
            "correct `robot` or `tool` in campaign.toml, or give another with --robot; what needs "
            "a robot was not checked",
        )
