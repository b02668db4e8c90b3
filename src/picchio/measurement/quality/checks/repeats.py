"""Do repeated records agree, and are channels or records copies of one another?"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from picchio.measurement.noise.repeats import Repeats, overlap
from picchio.measurement.noise.window import Window
from picchio.measurement.quality.check import Check, Context, Finding
from picchio.measurement.quality.scan import RecordScan


@dataclass(frozen=True)
class Comparison:
    """Two records of the same pose, direction and blows.

    Attributes:
        first, second: files.
        channel: where they differ most.
        difference: RMS of the difference over the RMS of the signal.
        over_noise: RMS of the difference over what the noise alone makes it.
        scale: of the second over the first.
    """

    first: str
    second: str
    channel: str
    difference: float
    over_noise: float
    scale: float


class RepeatsCheck(Check):
    """Each record against the one before it of the same pose, direction and blows."""

    name = "repeats"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self.comparisons: list[Comparison] = []
        self._repeats = Repeats(context.campaign)

    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """Against the one before."""
        before = self._repeats.before(scan.window)
        worst = self._compare(before, scan.window) if before is not None else None
        if worst is not None:
            self.comparisons.append(worst)
            if worst.over_noise > 1.3 and worst.difference > 0.03:
                percent = 100 * worst.difference
                yield self.found("differs", worst.second, worst.channel, worst.difference,
                                 first=worst.first, percent=percent, scale=worst.scale,
                                 mild=worst.difference <= 0.1)  # fmt: skip

    def _compare(self, one: Window, other: Window) -> Comparison | None:
        first, second = overlap(one, other)
        worst: Comparison | None = None
        for name in (name for name in one.arrays if name in other.arrays):
            a, b = one.arrays[name][first], other.arrays[name][second]
            if a.size < 64 or one.channels[name].kind.of_force:
                continue
            if np.ptp(a) == 0.0 or np.ptp(b) == 0.0:
                continue
            size = float(np.sqrt(np.mean(a**2)))
            expected = np.sqrt(2.0 * self.context.std(name) ** 2 + self.context.hum(name) ** 2)
            difference = float(np.sqrt(np.mean((b - a) ** 2)))
            over = difference / expected if expected > 0.0 else np.inf if difference else 1.0
            extra = np.sqrt(max(difference**2 - expected**2, 0.0)) / size
            scale = float(a @ b / (a @ a))
            found = Comparison(one.record.file, other.record.file, name, float(extra),
                               float(over), scale)  # fmt: skip
            if worst is None or found.difference > worst.difference:
                worst = found
        return worst


class CopiesCheck(Check):
    """Channels or records that are equal bit for bit: noise never is."""

    name = "copies"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._records: dict[bytes, tuple[str, str]] = {}

    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """Within one record, and against those before."""
        seen: dict[bytes, str] = {}
        told = False
        for name, values in scan.window.arrays.items():
            kind = scan.window.channels[name].kind
            if scan.channels[name].constant or values.size < 16 or kind.condition:
                continue
            # A force without noise is as programmed: it may well be the same twice.
            if kind.of_force and self.context.std(name) == 0.0:
                continue
            digest = hashlib.sha256(values.tobytes()).digest()
            if digest in seen:
                yield self.found("channel", scan.file, name, other=seen[digest])
            seen.setdefault(digest, name)
            known = self._records.get(digest)
            if known and known[1] == name and not told and kind.motion != "reference":
                told = True
                yield self.found("record", scan.file, name, other=known[0])
            self._records.setdefault(digest, (scan.file, name))
