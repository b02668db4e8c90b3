"""Are channels or records duplicated?"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator

from picchio.measurement.quality.check import Check, Context, Finding
from picchio.measurement.quality.scan import RecordScan


class CopiesCheck(Check):
    """Channels or records that are equal bit for bit: noise never is."""

    name = "copies"
    what = "channels or records that are exact copies"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._records: dict[bytes, tuple[str, str]] = {}

    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """Within one record, and against those before."""
        seen: dict[bytes, str] = {}
        told = False
        for name, values in scan.window.arrays.items():
            kind = scan.record.channel(name).kind.name
            if scan.channels[name].constant or values.size < 16 or kind == "temperature":
                continue
            if self._programmed(scan, name):
                continue
            digest = hashlib.sha256(values.tobytes()).digest()
            if digest in seen:
                yield self.found("warning", f"equals {seen[digest]} in every sample",
                                 "one of them is a copy: find out which sensor it is",
                                 record=scan.file, channel=name)  # fmt: skip
            seen.setdefault(digest, name)
            known = self._records.get(digest)
            if known and known[1] == name and not told and kind != "reference_position":
                told = True
                yield self.found("warning", f"equals that of {known[0]} in every sample",
                                 "one record was saved twice: leave it out",
                                 record=scan.file, channel=name)  # fmt: skip
            self._records.setdefault(digest, (scan.file, name))

    def _programmed(self, scan: RecordScan, name: str) -> bool:
        """A force or a command without noise may well be the same twice."""
        return name == "force" and self.context.std(name) == 0.0
