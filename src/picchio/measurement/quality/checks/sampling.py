"""Is the clock even and the same in all records, and fast enough for what is sampled?"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator

import numpy as np

from picchio.campaign.clock import TOLERANCE
from picchio.measurement.quality.check import Check, Context, Finding
from picchio.measurement.quality.scan import RecordScan

_SLOWEST, _FASTEST = 20.0, 2e6
_SAMPLES_A_BLOW = 3.0


class ClockCheck(Check):
    """Uneven clocks, lost samples, rates that differ or cannot be."""

    name = "clock"
    what = "even clock, plausible and equal sample rates"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._rates: dict[str, float] = {}

    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """Unevenness and rate of one record."""
        clock = scan.clock
        self._rates[scan.file] = clock.rate
        if clock.jitter > TOLERANCE:
            if clock.jitter > 0.9:
                text = f"the clock is not even: about {clock.jitter:.3g} samples are lost or added"
            else:
                text = f"the clock is not even: it is off by {clock.jitter:.2g} of a step"
            yield self.found(
                "error",
                f"{text} at {scan.line(clock.worst)}, t = {scan.when(clock.worst):.4g} s",
                "other commands refuse this record; resample it evenly (`picchio import` does)",
                record=scan.file, channel="time", value=clock.jitter, unit="steps",
            )  # fmt: skip
        if not _SLOWEST <= clock.rate <= _FASTEST:
            yield self.found(
                "warning",
                f"{clock.rate:.4g} samples a second is not plausible for a robot's vibration",
                "is the time really in seconds? the header may say ms or us",
                record=scan.file, channel="time", value=clock.rate, unit="Hz",
            )  # fmt: skip

    def finish(self) -> Iterator[Finding]:
        """Records with another rate than most."""
        if len(self._rates) < 2:
            return
        rounded = [round(rate, 3) for rate in self._rates.values()]
        usual = max(set(rounded), key=rounded.count)
        for file, rate in self._rates.items():
            if abs(rate / usual - 1.0) > 1e-3:
                plain = 0.5 < rate / usual < 2.0
                yield self.found(
                    "note" if not plain else "warning",
                    f"sampled at {rate:.6g} Hz, most of the others at {usual:.6g} Hz",
                    "right if it was set so; a clock that runs fast or slow looks the same"
                    if plain else "right if it was set so",
                    record=file, channel="time", value=rate, unit="Hz",
                )  # fmt: skip


class AliasingCheck(Check):
    """Signal close to half the sample rate: what lies above folds back unseen."""

    name = "aliasing"
    what = "signal near half the sample rate; samples a blow"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._shares: dict[str, list[tuple[float, str, float]]] = defaultdict(list)
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
            self._shares[name].append((share, scan.file, window.rate))
        width = (blows.width if blows is not None else None) or 0.0
        jumps = any(channel.kind.jumps for channel in window.channels.values())
        if jumps and width and width * window.rate < _SAMPLES_A_BLOW - 1e-6:
            self._thin.append((width * window.rate, scan.file))
        return ()

    def finish(self) -> Iterator[Finding]:
        """The worst record of every channel."""
        if self._thin:
            count, file = min(self._thin)
            yield self.found(
                "warning",
                f"a blow is only {count:.2g} samples wide in {len(self._thin)} records",
                "sample at five times a blow's width or faster, with an anti-alias filter",
                record=file if len(self._thin) == 1 else None, value=count, unit="samples",
            )  # fmt: skip
        for name, found in self._shares.items():
            share, file, rate = max(found)
            if share > 0.05:
                yield self.found(
                    "warning" if share > 0.3 else "note",
                    f"{100 * share:.2g} % of its amplitude lies above {0.4 * rate:.4g} Hz, close "
                    f"to half the sample rate of {rate:.4g} Hz",
                    "blows have sharp edges: above half the rate they fold back unseen; sample "
                    "faster, or filter before sampling",
                    record=file, channel=name, value=share,
                )  # fmt: skip
