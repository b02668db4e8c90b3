"""Is the clock even and the same in all records, and fast enough for what is sampled?"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from picchio.campaign.channels import TIME
from picchio.campaign.clock import TOLERANCE
from picchio.measurement.quality.check import Check, Context, Finding
from picchio.measurement.quality.scan import RecordScan

_SLOWEST, _FASTEST = 20.0, 2e6
_SAMPLES_A_BLOW = 3.0


class ClockCheck(Check):
    """Uneven clocks, lost samples, rates that differ or cannot be."""

    name = "clock"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._rates: dict[str, float] = {}

    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """Unevenness and rate of one record."""
        clock = scan.clock
        self._rates[scan.file] = clock.rate
        if clock.jitter > TOLERANCE:
            key = "lost" if clock.jitter > 0.9 else "uneven"
            place = scan.place(clock.worst)
            yield self.found(key, scan.file, TIME, clock.jitter, place=place)
        if not _SLOWEST <= clock.rate <= _FASTEST:
            yield self.found("implausible", scan.file, TIME, clock.rate)

    def finish(self) -> Iterator[Finding]:
        """Records with another rate than most."""
        if len(self._rates) < 2:
            return
        rounded = [round(rate, 3) for rate in self._rates.values()]
        usual = max(set(rounded), key=rounded.count)
        for file, rate in self._rates.items():
            if abs(rate / usual - 1.0) > 1e-3:
                key = "fast-or-slow" if 0.5 < rate / usual < 2.0 else "unlike"
                yield self.found(key, file, TIME, rate, usual=usual)


class AliasingCheck(Check):
    """Signal close to half the sample rate: what lies above folds back unseen."""

    name = "aliasing"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._thin: list[tuple[float, str]] = []

    def record(self, scan: RecordScan) -> Iterable[Finding]:
        """Power in the upper fifth of the spectrum, less that of the noise."""
        window = scan.window
        blows = window.blows
        for name, values in window.arrays.items():
            if window.record.kind != "percussion" or values.size < 128:
                continue
            if window.channels[name].kind.of_force:
                continue
            x = (values - values.mean()) * np.hanning(values.size)
            power = np.abs(np.fft.rfft(x)) ** 2 / values.size
            top = power[int(0.8 * power.size) : -1]
            std = self.context.std(name)
            beside = 1.3 * std**2 * 0.375 * top.size
            noise = self.context.noise.get(name)
            if noise is not None and not noise.white:
                f = np.linspace(0.4, 0.5, 16) * window.rate
                level = float(noise.at(window.rate).model.psd(f, window.rate).mean())
                beside = 1.3 * 0.375 * top.size * level * window.rate / 2.0
            extra = max(0.0, float(top.sum()) - beside)
            share = float(np.sqrt(extra / max(float(power.sum()), 1e-300)))
            self.kept[name].append((share, scan.file, window.rate))
        width = (blows.width if blows is not None else None) or 0.0
        jumps = any(channel.kind.jumps for channel in window.channels.values())
        if jumps and width and width * window.rate < _SAMPLES_A_BLOW - 1e-6:
            self._thin.append((width * window.rate, scan.file))
        return ()

    def finish(self) -> Iterator[Finding]:
        """The worst record of every channel."""
        if self._thin:
            count, file = min(self._thin)
            records = len(self._thin)
            yield self.found("thin", file if records == 1 else None, None, count, records=records)
        for name, found in self.kept.items():
            share, file, rate = max(found)
            if share > 0.05:
                yield self.found("high", file, name, share, percent=100 * share, above=0.4 * rate,
                                 rate=rate, mild=share <= 0.3)  # fmt: skip
