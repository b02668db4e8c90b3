"""What a check is, and what it may look at."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

from picchio.campaign.campaign import Campaign
from picchio.measurement.noise.level import Noise
from picchio.measurement.quality.scan import RecordScan
from picchio.robot.flexible_robot import FlexibleRobot

# One thing seen in measured data.

Severity = Literal["error", "warning", "note"]
SEVERITIES: tuple[Severity, ...] = ("error", "warning", "note")


@dataclass(frozen=True)
class Finding:
    """What a check saw, where, how much of it, and what to do.

    Attributes:
        check: the check's name.
        severity: "error" (these data cannot be used as they are), "warning" (they mislead if
            nothing is done), "note" (good to know).
        message: what was seen, without a full stop.
        advice: what to do, without a full stop.
        record: the record's file; None for the campaign.
        channel: or channel group, joint, frame; None for the record as a whole.
        value: the number that was seen.
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
    """What is known before the records are looked at one by one.

    Attributes:
        campaign: the campaign.
        robot: the robot, where there is one.
        noise: of every channel.
        periods: (programmed, found) of the steady records, s, by file.
        told: channel groups whose axes a check has spoken of already.
    """

    campaign: Campaign
    robot: FlexibleRobot | None
    noise: Mapping[str, Noise]
    periods: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    told: set[str] = field(default_factory=set)

    def std(self, channel: str) -> float:
        """Of a channel's noise; 0 where it is not known, or a rough floor."""
        noise = self.noise.get(channel)
        return noise.std if noise is not None else 0.0

    def hum(self, channel: str) -> float:
        """Amplitude of a channel's hum."""
        noise = self.noise.get(channel)
        return sum(line.amplitude for line in noise.hum) if noise is not None else 0.0


class Check(ABC):
    """Looks at the records one by one, and may say something at the end.

    Attributes:
        name: in findings.
        what: what it looks for, for people.
    """

    name: ClassVar[str]
    what: ClassVar[str]

    def __init__(self, context: Context) -> None:
        self.context = context

    @abstractmethod
    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """What is seen in one record."""

    def finish(self) -> Iterator[Finding]:
        """What is seen in all of them together."""
        yield from ()

    def found(self, severity: Severity, message: str, advice: str = "", *,
              record: str | None = None, channel: str | None = None,
              value: float | None = None, unit: str = "") -> Finding:  # fmt: skip
        """A finding of this check."""
        return Finding(self.name, severity, message, advice, record, channel, value, unit)
