"""Is the clock even, and the same in all records?"""

from __future__ import annotations

from collections.abc import Iterator

from picchio.campaign.clock import TOLERANCE
from picchio.measurement.quality.check import Check, Context, Finding
from picchio.measurement.quality.scan import RecordScan

_SLOWEST, _FASTEST = 20.0, 2e6


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
