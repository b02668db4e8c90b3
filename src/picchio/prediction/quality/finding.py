"""One thing seen in measured data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

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
