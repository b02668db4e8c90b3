"""A quality check of measured data: its findings, and what it works on."""

from __future__ import annotations

import tomllib
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, Literal

from picchio.campaign.campaign import Campaign
from picchio.measurement.noise.level import Noise
from picchio.measurement.quality.scan import RecordScan
from picchio.robot.flexible_robot import FlexibleRobot

Severity = Literal["error", "warning", "note"]
SEVERITIES: tuple[Severity, ...] = ("error", "warning", "note")


@cache
def catalogue() -> dict[str, dict[str, Any]]:
    """What each check looks for and may say, by its name: see `findings.toml`."""
    return tomllib.loads(Path(__file__).with_name("findings.toml").read_text(encoding="utf-8"))


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
        return dict(vars(self))


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
        name: in findings, and of its table in `findings.toml`.
        of: the kind of records that it sees, "percussion" or "motion"; all where empty.
        told: what has been reported, and is not to be at the next record.
        kept: what is kept of the records until the end.
    """

    name: ClassVar[str]
    of: ClassVar[str] = ""

    def __init__(self, context: Context) -> None:
        self.context = context
        self.told: set[str] = set()
        self.kept: defaultdict[Any, list[Any]] = defaultdict(list)

    def record(self, scan: RecordScan) -> Iterable[Finding]:
        """Findings in one record."""
        return ()

    def finish(self) -> Iterable[Finding]:
        """Findings in all records together."""
        return ()

    def found(
        self,
        key: str,
        record: str | None = None,
        channel: str | None = None,
        value: float | None = None,
        *,
        mild: bool = False,
        **words: object,
    ) -> Finding:
        """A finding of this check.

        Args:
            key: of its table in `findings.toml`.
            record: the record's file; None for the campaign.
            channel: channel, channel group, joint or frame; None for the whole record.
            value: the number found.
            mild: whether it is but a note.
            words: what else its texts are filled in with.
        """
        says = catalogue()[self.name][key]
        message, advice, unit = (
            says.get(part, "").format(value=value, **words)
            for part in ("message", "advice", "unit")
        )
        severity: Severity = "note" if mild else says["severity"]
        number = None if value is None else float(value)
        return Finding(self.name, severity, message, advice, record, channel, number, unit)
