"""What is in a campaign: one entry a record, and the campaign as a whole."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from picchio.prediction.quality.scan import RecordScan


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
