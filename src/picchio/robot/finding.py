"""What is impossible or doubtful about a robot's own numbers, as it is told and as it counts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Severity = Literal["impossible", "doubtful"]


@dataclass(frozen=True)
class Finding:
    """One number, or some of one kind, that no such robot has, or hardly any.

    Attributes:
        where: whose it is, such as "link forearm", "joint elbow" or "lengths".
        what: the number and why it stands out, a sentence without a full stop.
        cause: what probably went wrong; empty where nothing says so.
        severity: "impossible" (no such robot can be: nothing that follows from it is true) or
            "doubtful" (told, and believed).
    """

    where: str
    what: str
    cause: str = ""
    severity: Severity = "doubtful"

    def __str__(self) -> str:
        return f"{self.where}: {self.what}" + (f"; {self.cause}" if self.cause else "")
