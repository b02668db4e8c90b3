"""Samples that are no readings: sensors that are dead or fall silent, single samples far off."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.measurement.quality.check import Check, Finding
from picchio.measurement.quality.scan import ChannelScan, RecordScan, Run

_FEWEST = 5
_SIGMAS = 20.0
_ALONE = 2.5
# Of a motion's range: less is the encoder's own error.
_SMALL = 1e-4


class DropoutsCheck(Check):
    """Dead channels, and runs of equal samples longer than noise and resolution allow."""

    name = "dropouts"
    what = "sensors that are dead, or fall silent for a while"

    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """Every channel of one record."""
        motion = scan.record.kind == "motion"
        for name, seen in scan.channels.items():
            kind = scan.window.channels[name].kind
            if seen.constant:
                if motion and (kind.smooth or kind.condition):
                    continue  # a machine at rest
                yield self.found("warning", f"is {seen.least:.4g} throughout: the sensor is dead, "
                                 "or was never connected", "leave the channel out",
                                 record=scan.file, channel=name, value=seen.least)  # fmt: skip
                continue
            if motion and (kind.motion == "reference" or kind.condition):
                continue
            bad = [run for run in seen.runs if self._is_dropout(scan, name, seen, run)]
            if bad:
                longest = bad[0]
                held = "is exactly 0" if longest.value == 0.0 else f"stays at {longest.value:.6g}"
                places = f", and at {len(bad) - 1} more places" if len(bad) > 1 else ""
                yield self.found(
                    "warning",
                    f"{held} for {longest.length} samples from {scan.line(longest.start)}, "
                    f"t = {scan.when(longest.start):.4g} s{places}",
                    "data were lost there: leave out these samples, or the record",
                    record=scan.file, channel=name, value=float(longest.length), unit="samples",
                )  # fmt: skip

    def _is_dropout(self, scan: RecordScan, name: str, seen: ChannelScan, run: Run) -> bool:
        kind = scan.window.channels[name].kind
        if run.length < _FEWEST or run.value in (seen.least, seen.most):
            return False  # flat tops are clipping's business
        share = (seen.equal - (run.length - 1)) / max(seen.samples - run.length, 1)
        if share > 0.0:
            expected = np.log(seen.samples) / -np.log(min(share, 0.999))
            if run.length < 2.0 * expected + 4.0:
                return False
        if scan.record.kind == "motion":
            # A joint comes to rest smoothly; a lost signal jumps.
            return run.jump > 8.0 * seen.step and kind.derivative != 1
        noise = self.context.noise.get(name)
        if noise is None or noise.std == 0.0:
            # Without noise a channel stands still before the blow, and a force between blows.
            return kind.smooth and run.start > 0 and scan.when(run.start) > 0.0
        return True


class SpikesCheck(Check):
    """Isolated samples that no motion reaches and leaves again."""

    name = "spikes"
    what = "single samples far off their neighbours"

    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """Smooth channels everywhere; those that jump with the blows only while none falls."""
        window = scan.window
        motion = window.record.kind == "motion"
        for name, values in window.arrays.items():
            kind = window.channels[name].kind
            if values.size < 64 or kind.condition:
                continue
            if motion and kind.motion not in ("link", "motor"):
                continue  # drives switch, velocities are differences: spikes are their nature
            whole = slice(0, values.size)
            for part in [whole] if kind.smooth else [window.quiet(), window.after()]:
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
                        unit=window.channels[name].unit,
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
