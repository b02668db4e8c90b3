"""Is each channel's signal well above its noise and its resolution?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from picchio.measurement.quality.check import Check, Context, Finding
from picchio.measurement.quality.scan import RecordScan


class NoiseLevelCheck(Check):
    """Signal over noise, and the converter's steps."""

    name = "noise"
    what = "signal over noise, resolution"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._rms: dict[str, list[tuple[float, str]]] = {}
        self._seen: dict[str, str] = {}
        self._groups: dict[str, str] = {}

    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """The signal's size."""
        for name, seen in scan.channels.items():
            if not seen.constant:
                self._rms.setdefault(name, []).append((seen.rms, scan.file))
                self._seen[name] = scan.record.kind
                self._groups[name] = scan.record.channel(name).group
        yield from ()

    def finish(self) -> Iterator[Finding]:
        """Channels that hardly stand out; the rest is in the table of noise."""
        for name, sizes in self._rms.items():
            noise = self.context.noise.get(name)
            if noise is None:
                if self._seen[name] == "percussion":
                    yield self.found("note", "no part of the records shows its noise alone",
                                     "record 0.1 s before the first blow, or repeat a record",
                                     channel=name)  # fmt: skip
                continue
            if noise.rough or noise.std == 0.0:
                continue
            size = float(np.sqrt(np.mean([rms**2 for rms, _ in sizes])))
            ratio = np.sqrt(max(size**2 / noise.std**2 - 1.0, 0.0))
            if ratio < 10.0:
                group = self._groups[name]
                loud = max(rms for n, one in self._rms.items() if self._groups[n] == group
                           for rms, _ in one)  # fmt: skip
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
