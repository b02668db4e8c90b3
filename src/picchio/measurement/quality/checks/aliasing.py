"""Is the sampling fast enough for what is sampled?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from picchio.measurement.quality.check import Check, Context, Finding
from picchio.measurement.quality.scan import RecordScan

_SAMPLES_A_BLOW = 3.0


class AliasingCheck(Check):
    """Signal close to half the sample rate: what lies above folds back unseen."""

    name = "aliasing"
    what = "signal near half the sample rate; samples a blow"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._shares: dict[str, list[tuple[float, str, float]]] = {}
        self._thin: list[tuple[float, str]] = []

    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """Power in the upper fifth of the spectrum, less that of the noise."""
        window = scan.window
        blows = window.blows
        jumps = False
        for name, values in window.arrays.items():
            jumps = jumps or window.record.channel(name).kind.jumps
            if window.record.kind != "percussion" or values.size < 128 or name == "force":
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
            self._shares.setdefault(name, []).append((share, scan.file, window.rate))
        width = (blows.width if blows is not None else None) or 0.0
        if jumps and width and width * window.rate < _SAMPLES_A_BLOW - 1e-6:
            self._thin.append((width * window.rate, scan.file))
        yield from ()

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
