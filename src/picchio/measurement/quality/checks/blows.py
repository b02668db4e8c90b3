"""Is the record long enough, and do the blows have the programmed timing, number and force?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.excitation.excitation import Excitation
from picchio.measurement.noise.window import Window
from picchio.measurement.quality.check import Check, Finding
from picchio.measurement.quality.scan import RecordScan

_PERIODS = 3.0
_SIGMAS = 7.0
_FACTORS = {1e3: "N or kN?", 4.448: "N or lbf?", 9.81: "N or kgf?"}


class LengthCheck(Check):
    """Records that begin too late or end too early."""

    name = "length"
    of = "percussion"

    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """One percussion record."""
        window, clock = scan.window, scan.clock
        blows = window.blows
        if blows is None:
            return
        if window.steady:
            periods = (clock.end - clock.start + clock.step) / blows.period
            if periods < _PERIODS - 1e-6:
                key = "no-period" if periods < 1.0 - 1e-6 else "few-periods"
                yield self.found(key, scan.file, None, periods, period=1e3 * blows.period)
            return
        width = blows.width or 0.0
        if clock.start > max(0.5 * width, 1.01 * clock.step):
            yield self.found("late", scan.file, None, clock.start)
        elif window.quiet().stop < 20:
            yield self.found("no-quiet", scan.file, None, window.quiet().stop)
        hits = window.record.hits
        last = ((hits or 1) - 1) * blows.period + width
        if clock.end < last:
            seen = int(max(0.0, np.floor((clock.end - width) / blows.period) + 1))
            yield self.found("early", scan.file, None, clock.end, last=last, seen=seen, hits=hits)
        elif window.complete:
            yield from self._ring_down(scan)

    def _ring_down(self, scan: RecordScan) -> Iterator[Finding]:
        window = scan.window
        worst, where = 0.0, ""
        for name, values in window.arrays.items():
            std = self.context.std(name) + self.context.hum(name)
            part = values[window.after()]
            size = max(16, values.size // 20)
            if window.channels[name].kind.of_force or values.size < 4 * size:
                continue
            power = values[: values.size // size * size].reshape(-1, size)
            loudest = float(np.sqrt((power**2).mean(axis=1).max()))
            # A joint may come to rest elsewhere: about the mean of the end.
            rest = float(values[-4 * size :].mean())
            end = float(np.sqrt(np.mean((values[-size:] - rest) ** 2)))
            if part.size >= size and end > 4.0 * std and loudest > 0.0 and end / loudest > worst:
                worst, where = end / loudest, name
            elif part.size < size and loudest > 4.0 * std:
                worst, where = 1.0, name
        if worst > 0.1:
            yield self.found("ringing", scan.file, where, worst, percent=100 * worst,
                             mild=worst <= 0.6)  # fmt: skip


class BlowsCheck(Check):
    """The measured force against the programmed one; t = 0 against the first movement."""

    name = "blows"
    of = "percussion"

    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """One percussion record."""
        window = scan.window
        for name, channel in window.channels.items():
            if channel.kind.of_force and window.blows is not None:
                yield from self._force(scan, name, window.blows)
        yield from self._onset(scan)
        programmed, found = self.context.periods.get(scan.file, (1.0, 1.0))
        if abs(found / programmed - 1.0) > 2e-3:
            yield self.found("steady-period", scan.file, None, found, found=1e3 * found,
                             programmed=1e3 * programmed)  # fmt: skip

    def _force(self, scan: RecordScan, channel: str, blows: Excitation) -> Iterator[Finding]:
        force = scan.window.arrays[channel] - blows.preload
        programmed = blows.peak_force
        if not force.any() or programmed <= 0.0:
            return
        if -force.min() > 2.0 * force.max():
            yield self.found("flipped", scan.file, channel, force.min())
            force = -force
        peak = float(force.max())
        if blows.flat:
            peak = float(np.median(force[force > 0.6 * peak]))
        ratio = peak / programmed
        factor = not 1.0 / 3.0 < ratio < 3.0
        if factor or abs(ratio - 1.0) > max(0.03, 2.5 * self.context.campaign.tolerance.force):
            close = [w for f, w in _FACTORS.items() if abs(abs(np.log(ratio)) - np.log(f)) < 0.25]
            yield self.found(
                "factor" if factor else "size", scan.file, channel, ratio, peak=peak,
                programmed=programmed, percent=100 * (ratio - 1),
                guess=close[0] if close else "which one is right?",
            )  # fmt: skip
        yield from self._timing(scan.window, blows, force, peak, channel)

    def _timing(self, window: Window, blows: Excitation, force: FloatArray, peak: float,
                channel: str) -> Iterator[Finding]:  # fmt: skip
        file, hits = window.record.file, window.record.hits
        above = force > 0.5 * peak
        rising = np.flatnonzero(above[1:] & ~above[:-1]) + 1
        # Noise at the threshold is not another blow.
        times = window.time[rising]
        width = blows.width or 0.1 * blows.period
        times = times[np.insert(np.diff(times) > max(0.25 * blows.period, 0.5 * width), 0, True)]
        if not times.size:
            return
        if hits is not None and abs(times[0]) > max(1.6 * window.step, 0.25 * width):
            yield self.found("begin", file, channel, times[0], at=1e3 * times[0])
        if hits is not None and window.complete and times.size != hits:
            yield self.found("number", file, channel, times.size, hits=hits)
        if times.size >= 3 and (hits is None or times.size == hits):
            period = (times[-1] - times[0]) / (times.size - 1)
            slip = 2.0 * window.step / (times[-1] - times[0])
            if abs(period / blows.period - 1.0) > 2e-3 + slip:
                yield self.found("period", file, channel, period, found=1e3 * period,
                                 programmed=1e3 * blows.period)  # fmt: skip

    def _onset(self, scan: RecordScan) -> Iterator[Finding]:
        window = scan.window
        quiet = window.quiet()
        if quiet.stop < 20:
            return
        onsets = {}
        for name, values in window.arrays.items():
            std = self.context.std(name)
            if window.channels[name].kind.of_force or std == 0.0:
                continue
            x = values - np.median(values[: max(10, quiet.stop // 2)])
            moved = np.abs(x) > _SIGMAS * std + 1.5 * self.context.hum(name)
            steady = moved[:-2] & moved[1:-1] & moved[2:]
            if steady.any():
                onsets[name] = float(window.time[int(steady.argmax())])
        if not onsets:
            return
        name = min(onsets, key=lambda key: onsets[key])
        first, blows = onsets[name], window.blows
        late = 2.0 * ((blows.width if blows is not None else None) or 0.0) + 5e-3
        if first < -2.0 * window.step:
            yield self.found("moves-before", scan.file, name, first, at=-1e3 * first)
        elif first > max(late, 8.0 * window.step):
            yield self.found("moves-late", scan.file, name, first, at=1e3 * first)
