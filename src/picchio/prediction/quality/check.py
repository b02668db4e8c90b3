"""What a check is, and what it may look at."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import ClassVar

from picchio.campaign import Campaign
from picchio.prediction.noise_level import Noise
from picchio.prediction.quality.finding import Finding, Severity
from picchio.prediction.quality.scan import RecordScan
from picchio.robot import FlexibleRobot


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
