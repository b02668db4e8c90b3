"""Are the values plausible for their unit?"""

from __future__ import annotations

from collections.abc import Iterator

from picchio.measurement.quality.check import Check, Context, Finding
from picchio.measurement.quality.scan import RecordScan

# Of a percussion record, (kind, unit): the most that a robot's vibration plausibly is, and what
# a larger number may be.
_MOST = {
    ("deflection", "rad"): (0.05, "deg, or arcmin?"),
    ("deflection", "m"): (0.05, "mm?"),
    ("displacement", "m"): (0.1, "mm?"),
    ("velocity", "m/s"): (10.0, "mm/s?"),
    ("acceleration", "m/s^2"): (5e3, "mm/s^2?"),
    ("accelerometer", "m/s^2"): (5e3, "mm/s^2, or counts?"),
    ("force", "N"): (2e5, "mN, or counts?"),
}


class UnitsCheck(Check):
    """Sizes that are not plausible in the unit of the header."""

    name = "units"
    what = "sizes plausible in the header's unit"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._told: set[str] = set()

    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """Every channel of one record."""
        for name, seen in scan.channels.items():
            channel = scan.record.channel(name)
            size = max(-seen.least, seen.most)
            if channel.kind.name == "temperature" and not -60.0 < seen.most < 250.0:
                yield self.found("warning", f"reaches {seen.most:.4g} degC",
                                 "is it in K, or in raw counts?", record=scan.file,
                                 channel=name, value=seen.most, unit="degC")  # fmt: skip
            if scan.record.kind == "motion":
                continue
            most, guess = _MOST.get((channel.kind.name, channel.unit), (float("inf"), ""))
            if size > most and channel.group not in self._told:
                self._told.add(channel.group)
                yield self.found(
                    "warning", f"reaches {size:.4g} {channel.unit}, which no arm survives",
                    f"is the header's unit right? {guess}",
                    record=scan.file, channel=name, value=size, unit=channel.unit,
                )  # fmt: skip
