"""Is the record long enough: quiet time, all blows, the ring-down, whole periods?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from picchio.measurement.quality.check import Check, Finding
from picchio.measurement.quality.scan import RecordScan

_PERIODS = 3.0


class LengthCheck(Check):
    """Records that begin too late or end too early."""

    name = "length"
    what = "quiet time before, every blow, ring-down or whole periods covered"
    of = "percussion"

    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """One percussion record."""
        window, clock = scan.window, scan.clock
        blows = window.blows
        if blows is None:
            return
        if window.steady:
            periods = (clock.end - clock.start + clock.step) / blows.period
            if periods < 1.0 - 1e-6:
                yield self.found("error", f"covers {periods:.2g} of a period of "
                                 f"{1e3 * blows.period:.4g} ms", "record three periods or more",
                                 record=scan.file, value=periods, unit="periods")  # fmt: skip
            elif periods < _PERIODS - 1e-6:
                yield self.found("warning", f"covers {periods:.3g} periods: what repeats cannot be "
                                 "told from noise", "record three periods or more; more are better",
                                 record=scan.file, value=periods, unit="periods")  # fmt: skip
            return
        width = blows.width or 0.0
        if clock.start > max(0.5 * width, 1.01 * clock.step):
            yield self.found("warning", f"begins at t = {clock.start:.4g} s, after the first blow",
                             "t = 0 must be the first blow's first edge, with quiet time before",
                             record=scan.file, value=clock.start, unit="s")  # fmt: skip
        elif window.quiet().stop < 20:
            yield self.found("note", f"{window.quiet().stop} samples of quiet time before the "
                             "first blow", "0.1 s or more of it shows the noise as it is",
                             record=scan.file, value=float(window.quiet().stop),
                             unit="samples")  # fmt: skip
        last = ((window.record.hits or 1) - 1) * blows.period + width
        if clock.end < last:
            seen = int(max(0.0, np.floor((clock.end - width) / blows.period) + 1))
            yield self.found("warning", f"ends at t = {clock.end:.4g} s, before the last blow at "
                             f"{last:.4g} s: {seen} of {window.record.hits} blows are in it",
                             "record longer, or correct `hits`",
                             record=scan.file, value=clock.end, unit="s")  # fmt: skip
        elif window.complete:
            yield from self._ring_down(scan)

    def _ring_down(self, scan: RecordScan) -> Iterator[Finding]:
        window = scan.window
        worst, where = 0.0, ""
        for name, values in window.arrays.items():
            std = self.context.std(name) + self.context.hum(name)
            part = values[window.after()]
            size = max(16, values.size // 20)
            if window.channels[name].kind.of_force or values.size < 4 * size:
                continue
            power = values[: values.size // size * size].reshape(-1, size)
            loudest = float(np.sqrt((power**2).mean(axis=1).max()))
            # A joint may come to rest elsewhere: about the mean of the end.
            rest = float(values[-4 * size :].mean())
            end = float(np.sqrt(np.mean((values[-size:] - rest) ** 2)))
            if part.size >= size and end > 4.0 * std and loudest > 0.0 and end / loudest > worst:
                worst, where = end / loudest, name
            elif part.size < size and loudest > 4.0 * std:
                worst, where = 1.0, name
        if worst > 0.1:
            yield self.found(
                "warning" if worst > 0.6 else "note",
                f"ends while still ringing, at {100 * worst:.0f} % of the largest amplitude",
                "record until it is quiet: the decay shows the damping",
                record=scan.file, channel=where, value=worst,
            )  # fmt: skip
