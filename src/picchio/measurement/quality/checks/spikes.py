"""Single samples that differ from their neighbours."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.measurement.quality.check import Check, Finding
from picchio.measurement.quality.scan import RecordScan

_SIGMAS = 20.0
_ALONE = 2.5
_POSITIONS = ("position", "motor_position")
_SMOOTH = ("deflection", "displacement", "velocity", *_POSITIONS)
# Of a motion's range: less is the encoder's own error.
_SMALL = 1e-4


class SpikesCheck(Check):
    """Isolated samples that no motion reaches and leaves again."""

    name = "spikes"
    what = "single samples far off their neighbours"

    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """Smooth channels everywhere; those that jump with the blows only while none falls."""
        window = scan.window
        for name, values in window.arrays.items():
            kind = window.record.channel(name).kind.name
            if values.size < 64 or kind == "temperature":
                continue
            motion = window.record.kind == "motion"
            if motion and kind not in _POSITIONS:
                continue  # drives switch, velocities are differences: spikes are their nature
            everywhere = kind in _SMOOTH
            whole = slice(0, values.size)
            for part in [whole] if everywhere else [window.quiet(), window.after()]:
                least = _SMALL * float(np.ptp(values)) if motion else 0.0
                spikes = _spikes(values[part], max(self.context.std(name), least / 8.0))
                if 0 < spikes.size <= max(3, values.size // 200):
                    at = part.start + int(spikes[0])
                    height = abs(values[at] - 0.5 * (values[at - 1] + values[at + 1]))
                    more = f", and {spikes.size - 1} more" if spikes.size > 1 else ""
                    yield self.found(
                        "warning",
                        f"one sample differs from its neighbours by {height:.3g} at "
                        f"{scan.line(at)}, t = {scan.when(at):.4g} s{more}",
                        "a lost bit or a bad contact: replace it with its neighbours' mean",
                        record=scan.file, channel=name, value=float(height),
                        unit=window.record.channel(name).unit,
                    )  # fmt: skip


def _spikes(values: FloatArray, std: float) -> FloatArray:
    """Indices of samples far from both neighbours, which agree with each other."""
    if values.size < 64:
        return np.zeros(0, dtype=np.intp)
    off = values[1:-1] - 0.5 * (values[:-2] + values[2:])
    spread = 1.4826 * float(np.median(np.abs(off)))
    if spread == 0.0:
        spread = float(np.mean(np.abs(off)))
    limit = max(_SIGMAS * spread, 8.0 * std)
    size, across = np.abs(off), np.abs(values[2:] - values[:-2])
    found = np.flatnonzero((size > limit) & (across < 0.25 * size))
    # They stand alone: a mode that rings near half the sample rate looks like many of them.
    rest = size.copy()
    for shift in (-1, 0, 1):
        rest[np.clip(found + shift, 0, rest.size - 1)] = 0.0
    return found[size[found] > _ALONE * rest.max()] + 1
