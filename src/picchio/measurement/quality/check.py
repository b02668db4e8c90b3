"""A quality check of measured data: its findings, and what it works on."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

from picchio.campaign.campaign import Campaign
from picchio.measurement.noise.level import Noise
from picchio.measurement.quality.scan import RecordScan
from picchio.robot.flexible_robot import FlexibleRobot

Severity = Literal["error", "warning", "note"]
SEVERITIES: tuple[Severity, ...] = ("error", "warning", "note")


@dataclass(frozen=True)
class Finding:
    """One thing a check found in measured data.

    Attributes:
        check: the check's name.
        severity: "error" (the data cannot be used as they are), "warning" (they mislead unless
            corrected), "note" (good to know).
        message: what was found, without a full stop.
        advice: what to do, without a full stop.
        record: the record's file; None for the campaign.
        channel: channel, channel group, joint or frame; None for the whole record.
        value: the number found.
        unit: of `value`.
    """

    check: str
    severity: Severity
    message: str
    advice: str = ""
    record: str | None = None
    channel: str | None = None
    value: float | None = None
    unit: str = ""

    def __str__(self) -> str:
        place = ", ".join(part for part in (self.record, self.channel) if part)
        advice = f"; {self.advice}" if self.advice else ""
        return (f"{place}: " if place else "") + self.message + advice

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__}


@dataclass(frozen=True, eq=False)
class Context:
    """What the checks know of the campaign before they see the records one by one.

    Attributes:
        campaign: the campaign.
        robot: the robot, where there is one.
        noise: of every channel.
        periods: (programmed, found) of the steady records, s, by file.
        told: channel groups whose axes have been reported already.
    """

    campaign: Campaign
    robot: FlexibleRobot | None
    noise: Mapping[str, Noise]
    periods: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    told: set[str] = field(default_factory=set)

    def std(self, channel: str) -> float:
        """Standard deviation of a channel's noise; 0 where it is not known."""
        noise = self.noise.get(channel)
        return noise.std if noise is not None else 0.0

    def hum(self, channel: str) -> float:
        """Amplitude of a channel's hum."""
        noise = self.noise.get(channel)
        return sum(line.amplitude for line in noise.hum) if noise is not None else 0.0


class Check:
    """Sees the records one by one, and may report at each of them and at the end.

    Attributes:
        name: in findings.
        what: what it looks for, in words.
        of: the kind of records that it sees, "percussion" or "motion"; all where empty.
        told: what has been reported, and is not to be at the next record.
    """

    name: ClassVar[str]
    what: ClassVar[str]
    of: ClassVar[str] = ""

    def __init__(self, context: Context) -> None:
        self.context = context
        self.told: set[str] = set()

    def record(self, scan: RecordScan) -> Iterable[Finding]:
        """Findings in one record."""
        return ()

    def finish(self) -> Iterable[Finding]:
        """Findings in all records together."""
        return ()

    def found(self, severity: Severity, message: str, advice: str = "", *,
              record: str | None = None, channel: str | None = None,
              value: float | None = None, unit: str = "") -> Finding:  # fmt: skip
        """A finding of this check."""
        return Finding(self.name, severity, message, advice, record, channel, value, unit)
