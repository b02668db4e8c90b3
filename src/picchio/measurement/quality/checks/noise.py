"""Noise against the signal: is a channel well above its noise and its resolution, does it hum?"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator

import numpy as np

from picchio.campaign.record import Record
from picchio.measurement.quality.check import Check, Context, Finding
from picchio.measurement.quality.scan import RecordScan


class _SizeCheck(Check):
    """Gathers how large every channel's signal is, record by record."""

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._rms: dict[str, list[float]] = defaultdict(list)
        self._last: dict[str, Record] = {}

    def record(self, scan: RecordScan) -> Iterable[Finding]:
        """The signal's size."""
        for name, seen in scan.channels.items():
            if not seen.constant:
                self._rms[name].append(seen.rms)
                self._last[name] = scan.record
        return ()

    def _size(self, name: str) -> float:
        """RMS over the records."""
        return float(np.sqrt(np.mean(np.square(self._rms[name]))))

    def _group(self, name: str) -> str:
        return self._last[name].channel(name).group


class HumCheck(_SizeCheck):
    """Lines at the mains' frequency in what should be noise."""

    name = "hum"
    what = "mains hum, 50 or 60 Hz"

    def finish(self) -> Iterator[Finding]:
        """Every channel with a line."""
        for name, noise in self.context.noise.items():
            if not noise.hum or name not in self._rms:
                continue
            size = self._size(name)
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


class NoiseLevelCheck(_SizeCheck):
    """Signal over noise, and the converter's steps."""

    name = "noise"
    what = "signal over noise, resolution"

    def finish(self) -> Iterator[Finding]:
        """Channels that hardly stand out; the rest is in the table of noise."""
        for name in self._rms:
            noise = self.context.noise.get(name)
            if noise is None:
                if self._last[name].kind == "percussion":
                    yield self.found("note", "no part of the records shows its noise alone",
                                     "record 0.1 s before the first blow, or repeat a record",
                                     channel=name)  # fmt: skip
                continue
            if noise.rough or noise.std == 0.0:
                continue
            size = self._size(name)
            ratio = np.sqrt(max(size**2 / noise.std**2 - 1.0, 0.0))
            if ratio < 10.0:
                group = self._group(name)
                loud = max(max(rms) for n, rms in self._rms.items() if self._group(n) == group)
                # A joint or axis that hardly takes part is no fault.
                yield self.found(
                    "warning" if ratio < 3.0 and loud < 10.0 * noise.std else "note",
                    f"the signal is only {ratio:.2g} times its noise of {noise.std:.3g} "
                    f"{noise.unit}",
                    "hit harder, or take a more sensitive sensor", channel=name,
                    value=float(ratio),
                )  # fmt: skip
            if noise.resolution > 3.0 * noise.std or noise.resolution > 0.05 * size:
                yield self.found(
                    "warning" if noise.resolution > max(0.05 * size, noise.std) else "note",
                    f"comes in steps of {noise.resolution:.3g} {noise.unit}, "
                    f"{100 * noise.resolution / size:.2g} % of the signal",
                    "write more digits, or set a smaller range", channel=name,
                    value=noise.resolution, unit=noise.unit,
                )  # fmt: skip
