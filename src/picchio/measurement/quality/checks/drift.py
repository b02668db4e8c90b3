"""Does a channel's zero drift, or is it offset?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from picchio.campaign.channels import Channel
from picchio.core.arrays import FloatArray
from picchio.measurement.quality.check import Check, Finding
from picchio.measurement.quality.scan import RecordScan

_SIGMAS = 6.0
_G = 9.81
# Of the signal: a joint that creeps to rest under friction stays below.
_SHARE = 0.1


class DriftCheck(Check):
    """Zeros that wander within a record, or are not zero."""

    name = "drift"
    of = "percussion"

    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """Every channel of one percussion record."""
        window = scan.window
        for name, values in window.arrays.items():
            channel = window.channels[name]
            if channel.kind.of_force or scan.channels[name].constant:
                continue
            size, quiet = float(values.std()), window.quiet()
            if window.steady:
                yield from self._steady(scan, channel, values, size)
                continue
            rate = self._wander(scan, name, values, size)
            if rate is not None:
                seconds = window.step * (values.size - 1)
                yield self.found("wanders", scan.file, name, rate, of=channel.unit,
                                 percent=100 * abs(rate) * seconds / size)  # fmt: skip
            elif quiet.stop >= 20:
                zero = float(values[quiet].mean())
                error = self._error(name, window.rate, quiet.stop, flat=True)
                error += self.context.hum(name) / np.sqrt(quiet.stop)
                if abs(zero) > _SIGMAS * error and abs(zero) > 0.02 * size:
                    felt = channel.kind.derivative == 2 and 0.2 * _G < abs(zero) < 1.05 * _G
                    yield self.found("gravity" if felt else "offset", scan.file, name, zero,
                                     of=channel.unit, times=zero / size)  # fmt: skip

    def _wander(self, scan: RecordScan, name: str, values: FloatArray, size: float) -> float | None:
        """Unit/s at which the zero moves, if it does so after the blows as before and during."""
        window = scan.window
        quiet, after = window.quiet(), window.after()
        half = (after.stop - after.start) // 2
        if half * window.step < 0.25 or quiet.stop < 20:
            return None
        first = values[after.start : after.start + half]
        last = values[after.stop - half : after.stop]
        steps = _centre(first) - float(values[quiet].mean()), _centre(last) - _centre(first)
        middle = window.time[after.start + half // 2]
        spans = middle - float(window.time[quiet].mean()), half * window.step
        leak = 0.05 * float(first.std())
        error = self._error(name, window.rate, min(half, quiet.stop)) * np.sqrt(2.0)
        least = max(_SIGMAS * error + leak, _SHARE * size)
        rates = [step / span for step, span in zip(steps, spans, strict=True)]
        # A joint with backlash comes to rest elsewhere, but does not go on.
        alike = rates[0] * rates[1] > 0.0 and 0.5 < abs(rates[1] / rates[0]) < 2.0
        if min(abs(step) for step in steps) > least and alike:
            return float(sum(steps) / sum(spans))
        return None

    def _steady(
        self, scan: RecordScan, channel: Channel, values: FloatArray, size: float
    ) -> Iterator[Finding]:
        window, name = scan.window, channel.name
        period = self.context.periods.get(scan.file, (0.0, 0.0))[1]
        if not period:
            return
        per = max(1, round(period * window.rate))
        count = values.size // per
        mean = float(values[: count * per].mean()) if count else float(values.mean())
        error = self._error(name, window.rate, values.size, flat=True)
        # A period is no whole number of samples, and the mean may be that of all samples.
        ragged = size * (1.0 / values.size * per + 1.0 / per)
        if abs(mean) > _SIGMAS * error + ragged and abs(mean) > 0.02 * size:
            yield self.found("mean", scan.file, name, mean, of=channel.unit, times=mean / size)
        if count < 4:
            return
        half = count // 2 * per
        change = float(values[half : 2 * half].mean() - values[:half].mean())
        error = self._error(name, window.rate, half, flat=True) * np.sqrt(2.0)
        if abs(change) > _SIGMAS * error + size / half and abs(change) > 0.02 * size:
            yield self.found("unsteady", scan.file, name, change, of=channel.unit,
                             percent=100 * abs(change) / size)  # fmt: skip

    def _error(self, name: str, rate: float, samples: int, flat: bool = False) -> float:
        """Of a mean over so many samples; a Hann window counts two thirds of them."""
        noise = self.context.noise.get(name)
        if noise is None:
            return 0.0
        level = float(noise.at(rate).model.psd(0.0, rate)) * rate / 2.0
        return float(np.sqrt(max(level, noise.std**2) / samples * (1.0 if flat else 1.5)))


def _centre(values: FloatArray) -> float:
    """The mean under a Hann window, which waves of two turns and more do not reach."""
    weight = np.hanning(values.size)
    return float(weight @ values / weight.sum())
