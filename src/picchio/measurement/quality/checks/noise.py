"""Noise against the signal: is a channel well above its noise and its resolution, does it hum?"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from picchio.campaign.record import Record
from picchio.measurement.quality.check import Check, Finding
from picchio.measurement.quality.scan import RecordScan


class _SizeCheck(Check):
    """Gathers how large every channel's signal is, record by record."""

    def record(self, scan: RecordScan) -> Iterable[Finding]:
        """The signal's size."""
        for name, seen in scan.channels.items():
            if not seen.constant:
                self.kept[name].append((seen.rms, scan.record))
        return ()

    def _size(self, name: str) -> float:
        """RMS over the records."""
        return float(np.sqrt(np.mean([rms**2 for rms, _ in self.kept[name]])))

    def _last(self, name: str) -> Record:
        """The last record with this channel."""
        record: Record = self.kept[name][-1][1]
        return record


class HumCheck(_SizeCheck):
    """Lines at the mains' frequency in what should be noise."""

    name = "hum"

    def finish(self) -> Iterator[Finding]:
        """Every channel with a line."""
        for name, noise in self.context.noise.items():
            if not noise.hum or name not in self.kept:
                continue
            size = self._size(name)
            main = noise.hum[0]
            share = main.amplitude / size if size > 0.0 else np.inf
            loud = share > 0.02 or main.amplitude > 0.5 * noise.std
            more = f" and {len(noise.hum) - 1} harmonics" if len(noise.hum) > 1 else ""
            yield self.found("line", None, name, main.amplitude, frequency=main.frequency,
                             more=more, of=noise.unit, percent=100 * share,
                             mild=not loud)  # fmt: skip


class NoiseLevelCheck(_SizeCheck):
    """Signal over noise, and the converter's steps."""

    name = "noise"

    def finish(self) -> Iterator[Finding]:
        """Channels that hardly stand out; the rest is in the table of noise."""
        for name in self.kept:
            noise = self.context.noise.get(name)
            if noise is None:
                if self._last(name).kind == "percussion":
                    yield self.found("unseen", channel=name)
                continue
            if noise.rough or noise.std == 0.0:
                continue
            size = self._size(name)
            ratio = np.sqrt(max(size**2 / noise.std**2 - 1.0, 0.0))
            if ratio < 10.0:
                group = self._last(name).channel(name).group
                loud = max(rms for n, kept in self.kept.items() for rms, _ in kept
                           if self._last(n).channel(n).group == group)  # fmt: skip
                # A joint or axis that hardly takes part is no fault.
                mild = not (ratio < 3.0 and loud < 10.0 * noise.std)
                yield self.found("loud", None, name, ratio, std=noise.std, of=noise.unit, mild=mild)
            step = noise.resolution
            if step > 3.0 * noise.std or step > 0.05 * size:
                yield self.found("steps", None, name, step, of=noise.unit,
                                 percent=100 * step / size,
                                 mild=step <= max(0.05 * size, noise.std))  # fmt: skip
