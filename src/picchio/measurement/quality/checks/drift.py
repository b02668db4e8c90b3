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
    what = "zeros that wander, or are none"
    of = "percussion"

    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """Every channel of one percussion record."""
        window = scan.window
        for name, values in window.arrays.items():
            channel = window.channels[name]
            if channel.kind.of_force or scan.channels[name].constant:
                continue
            unit = channel.unit
            size = float(np.sqrt(np.mean((values - values.mean()) ** 2)))
            quiet = window.quiet()
            if window.steady:
                yield from self._steady(scan, name, values, size, unit)
                continue
            rate = self._wander(scan, name, values, size)
            if rate is not None:
                seconds = window.step * (values.size - 1)
                yield self.found(
                    "warning",
                    f"its zero wanders: {rate:+.3g} {unit} a second, "
                    f"{100 * abs(rate) * seconds / size:.2g} % of the signal within the record",
                    "let the sensor warm up; subtract a line fitted to quiet time",
                    record=scan.file, channel=name, value=rate, unit=f"{unit}/s",
                )  # fmt: skip
                continue
            if quiet.stop >= 20:
                zero = float(values[quiet].mean())
                error = self._error(name, window.rate, quiet.stop, flat=True)
                error += self.context.hum(name) / np.sqrt(quiet.stop)
                if abs(zero) > _SIGMAS * error and abs(zero) > 0.02 * size:
                    yield self._offset(scan, channel, zero, size)

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
        leak = 0.05 * float(np.sqrt(np.mean((first - first.mean()) ** 2)))
        error = self._error(name, window.rate, min(half, quiet.stop)) * np.sqrt(2.0)
        least = max(_SIGMAS * error + leak, _SHARE * size)
        rates = [step / span for step, span in zip(steps, spans, strict=True)]
        # A joint with backlash comes to rest elsewhere, but does not go on.
        alike = rates[0] * rates[1] > 0.0 and 0.5 < abs(rates[1] / rates[0]) < 2.0
        if min(abs(step) for step in steps) > least and alike:
            return float(sum(steps) / sum(spans))
        return None

    def _offset(self, scan: RecordScan, channel: Channel, zero: float, size: float) -> Finding:
        gravity = channel.kind.derivative == 2 and 0.2 * _G < abs(zero) < 1.05 * _G
        return self.found(
            "warning",
            f"is {zero:+.3g} {channel.unit} before the first blow, {zero / size:+.2g} times the "
            "signal",
            "it must be less its value at rest: gravity is still in it" if gravity
            else "it must be less its value at rest: take the mean of the quiet time off",
            record=scan.file, channel=channel.name, value=zero, unit=channel.unit,
        )  # fmt: skip

    def _steady(self, scan: RecordScan, name: str, values: FloatArray, size: float,
                unit: str) -> Iterator[Finding]:  # fmt: skip
        window = scan.window
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
            yield self.found(
                "warning", f"has a mean of {mean:+.3g} {unit}, {mean / size:+.2g} times the signal",
                "subtract each channel's mean from steady records",
                record=scan.file, channel=name, value=mean, unit=unit,
            )  # fmt: skip
        if count < 4:
            return
        half = count // 2 * per
        change = float(values[half : 2 * half].mean() - values[:half].mean())
        error = self._error(name, window.rate, half, flat=True) * np.sqrt(2.0)
        if abs(change) > _SIGMAS * error + size / half and abs(change) > 0.02 * size:
            yield self.found(
                "warning",
                f"its zero wanders: {change:+.3g} {unit} from the first half of the record to the "
                f"second, {100 * abs(change) / size:.2g} % of the signal",
                "let the sensor warm up, and wait until the response is steady",
                record=scan.file, channel=name, value=change, unit=unit,
            )  # fmt: skip

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
