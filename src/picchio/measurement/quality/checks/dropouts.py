"""Does a channel stay constant where it should not: dead sensors, held or zeroed samples?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from picchio.measurement.quality.check import Check, Finding
from picchio.measurement.quality.scan import ChannelScan, RecordScan, Run

_FEWEST = 5
# Of a machine at rest, and of commands: long runs of equal samples are no fault.
_MAY_REST = ("position", "motor_position", "reference_position", "temperature", "velocity")


class DropoutsCheck(Check):
    """Dead channels, and runs of equal samples longer than noise and resolution allow."""

    name = "dropouts"
    what = "sensors that are dead, or fall silent for a while"

    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """Every channel of one record."""
        for name, seen in scan.channels.items():
            kind = scan.record.channel(name).kind.name
            if seen.constant:
                if scan.record.kind == "motion" and kind in _MAY_REST:
                    continue
                yield self.found("warning", f"is {seen.least:.4g} throughout: the sensor is dead, "
                                 "or was never connected", "leave the channel out",
                                 record=scan.file, channel=name, value=seen.least)  # fmt: skip
                continue
            if scan.record.kind == "motion" and kind in ("reference_position", "temperature"):
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
        channel = scan.record.channel(name)
        if run.length < _FEWEST or run.value in (seen.least, seen.most):
            return False  # flat tops are clipping's business
        share = (seen.equal - (run.length - 1)) / max(seen.samples - run.length, 1)
        if share > 0.0:
            expected = np.log(seen.samples) / -np.log(min(share, 0.999))
            if run.length < 2.0 * expected + 4.0:
                return False
        if scan.record.kind == "motion":
            # A joint comes to rest smoothly; a lost signal jumps.
            return run.jump > 8.0 * seen.step and channel.kind.name != "velocity"
        noise = self.context.noise.get(name)
        if noise is None or noise.std == 0.0:
            # Without noise a channel stands still before the blow, and a force between blows.
            smooth = channel.kind.name in ("deflection", "displacement", "velocity")
            return smooth and run.start > 0 and scan.when(run.start) > 0.0
        return True
