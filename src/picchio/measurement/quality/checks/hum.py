"""Mains hum."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from picchio.measurement.quality.check import Check, Context, Finding
from picchio.measurement.quality.scan import RecordScan


class HumCheck(Check):
    """Lines at the mains' frequency in what should be noise."""

    name = "hum"
    what = "mains hum, 50 or 60 Hz"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._power: dict[str, list[float]] = {}

    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """The signal's size, to compare."""
        for name, seen in scan.channels.items():
            self._power.setdefault(name, []).append(seen.rms**2)
        yield from ()

    def finish(self) -> Iterator[Finding]:
        """Every channel with a line."""
        for name, noise in self.context.noise.items():
            if not noise.hum or name not in self._power:
                continue
            size = float(np.sqrt(np.mean(self._power[name])))
            main = noise.hum[0]
            share = main.amplitude / size if size > 0.0 else np.inf
            loud = share > 0.02 or main.amplitude > 0.5 * noise.std
            more = f" and {len(noise.hum) - 1} harmonics" if len(noise.hum) > 1 else ""
            yield self.found(
                "warning" if loud else "note",
                f"hums at {main.frequency:.4g} Hz{more}, amplitude {main.amplitude:.3g} "
                f"{noise.unit}: {100 * share:.2g} % of the signal's RMS",
                "shield or ground the cable; the hum is estimated and can be removed",
                channel=name, value=main.amplitude, unit=noise.unit,
            )  # fmt: skip
