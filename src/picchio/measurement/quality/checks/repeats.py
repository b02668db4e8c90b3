"""Do repeated records agree?"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.measurement.noise.estimate import repeat_key
from picchio.measurement.noise.window import Window
from picchio.measurement.quality.check import Check, Context, Finding
from picchio.measurement.quality.scan import RecordScan

_SAMPLES = 16384
_BUDGET = 4 << 20


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
    what = "records that repeat each other"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self.comparisons: list[Comparison] = []
        self._before: dict[tuple[object, ...], Window] = {}
        self._kept = 0

    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """Against the one before."""
        key = repeat_key(scan.record)
        if key is None:
            return
        before = self._before.pop(key, None)
        if before is not None:
            self._kept -= _numbers(before)
            worst = self._compare(before, scan.window)
            if worst is not None:
                self.comparisons.append(worst)
                yield from self._judge(worst)
        if self._kept < _BUDGET:
            window = scan.window
            arrays = {name: v[:_SAMPLES].copy() for name, v in window.arrays.items()}
            kept = Window(window.record, window.time[:_SAMPLES].copy(), arrays, False, window.rate)
            self._before[key] = kept
            self._kept += _numbers(kept)

    def _compare(self, one: Window, other: Window) -> Comparison | None:
        if abs(one.rate / other.rate - 1.0) > 1e-6:
            return None
        shift = round((other.time[0] - one.time[0]) * one.rate)
        worst: Comparison | None = None
        for name in one.arrays.keys() & other.arrays.keys():
            a, b = _aligned(one.arrays[name], other.arrays[name], shift)
            size = float(np.sqrt(np.mean(a**2)))
            if a.size < 64 or name == "force" or np.ptp(a) == 0.0 or np.ptp(b) == 0.0:
                continue
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

    def _judge(self, worst: Comparison) -> Iterator[Finding]:
        if worst.over_noise > 1.3 and worst.difference > 0.03:
            loud = worst.difference > 0.1
            yield self.found(
                "warning" if loud else "note",
                f"differs from its repeat {worst.first} by {100 * worst.difference:.2g} % of the "
                f"signal beyond the noise; its best scale is {worst.scale:.3g}",
                "blows, temperature or fixture changed between them; or one pose or direction is "
                "wrong",
                record=worst.second, channel=worst.channel, value=worst.difference,
            )  # fmt: skip


def _aligned(a: FloatArray, b: FloatArray, shift: int) -> tuple[FloatArray, FloatArray]:
    a, b = (a[shift:], b) if shift >= 0 else (a, b[-shift:])
    m = min(a.size, b.size)
    return a[:m], b[:m]


def _numbers(window: Window) -> int:
    return window.time.size * (len(window.arrays) + 1)
