"""One pass over a record: statistics of all of it, and its first part in memory."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from picchio.campaign.clock import Clock
from picchio.campaign.record import Record
from picchio.core.arrays import FloatArray
from picchio.measurement.noise.window import Window, WindowCollector

_RUNS = 8


@dataclass(frozen=True)
class Run:
    """Samples in a row that are exactly equal.

    Attributes:
        start: index of the first.
        length: how many.
        value: what they are.
        jump: the larger of the steps that lead in and out of it; 0 at the record's ends.
    """

    start: int
    length: int
    value: float
    jump: float


@dataclass
class ChannelScan:
    """A channel's numbers over the whole record.

    Attributes:
        samples, least, most, mean, power: count, extremes, mean, mean square.
        equal: how many samples equal the one before.
        step: the mean absolute difference of neighbours that differ.
        runs: the longest runs of equal samples, longest first.
    """

    samples: int = 0
    least: float = np.inf
    most: float = -np.inf
    total: float = 0.0
    squares: float = 0.0
    equal: int = 0
    moved: float = 0.0
    runs: list[Run] = field(default_factory=list)
    _last: float = np.nan
    _run_start: int = 0
    _jump_in: float = 0.0

    @property
    def mean(self) -> float:
        """Of all samples."""
        return self.total / max(self.samples, 1)

    @property
    def rms(self) -> float:
        """Root mean square about the mean."""
        return float(np.sqrt(max(self.squares / max(self.samples, 1) - self.mean**2, 0.0)))

    @property
    def step(self) -> float:
        """Mean absolute difference of neighbours that differ."""
        return self.moved / max(self.samples - 1 - self.equal, 1)

    @property
    def constant(self) -> bool:
        """Every sample is the same."""
        return self.least == self.most

    def feed(self, values: FloatArray) -> None:
        """Take the next block."""
        self.least = min(self.least, float(values.min()))
        self.most = max(self.most, float(values.max()))
        self.total += float(values.sum())
        self.squares += float(values @ values)
        joined = values if self.samples == 0 else np.concatenate([[self._last], values])
        steps = np.diff(joined)
        at = max(self.samples, 1)
        changes = np.flatnonzero(steps)
        self.equal += steps.size - changes.size
        self.moved += float(np.abs(steps).sum())
        starts = np.concatenate([[self._run_start], at + changes])
        jumps = np.concatenate([[self._jump_in], np.abs(steps[changes])])
        lengths = np.diff(starts)
        if lengths.size:
            for k in np.argsort(lengths)[::-1][:_RUNS]:
                begin, length = int(starts[k]), int(lengths[k])
                if length > 2:
                    value = float(joined[begin - at + 1]) if begin >= at - 1 else self._last
                    self._keep(Run(begin, length, value, float(max(jumps[k], jumps[k + 1]))))
        self._run_start, self._jump_in = int(starts[-1]), float(jumps[-1])
        self._last = float(values[-1])
        self.samples += values.size

    def close(self) -> None:
        """The record has ended."""
        length = self.samples - self._run_start
        if length > 2:
            self._keep(Run(self._run_start, length, self._last, self._jump_in))

    def _keep(self, run: Run) -> None:
        self.runs = sorted([*self.runs, run], key=lambda r: -r.length)[:_RUNS]


@dataclass(frozen=True, eq=False)
class RecordScan:
    """What one pass over a record saw.

    Attributes:
        record: it.
        window: its leading part.
        channels: numbers of the whole, by channel.
        clock: how it ticks; taken however uneven.
    """

    record: Record
    window: Window
    channels: dict[str, ChannelScan]
    clock: Clock

    @property
    def file(self) -> str:
        """The record's name."""
        return self.record.file

    def place(self, sample: int) -> str:
        """Where a sample is, in words.

        Args:
            sample: its index.
        """
        source = self.record.source
        line = f"{source.row_word} {sample + source.first_row}"
        return f"{line}, t = {self.when(sample):.4g} s"

    def when(self, sample: int) -> float:
        """s, the time of a sample.

        Args:
            sample: its index.
        """
        return self.clock.start + sample * self.clock.step


def scan_record(record: Record) -> RecordScan:
    """Read a record once, in constant memory.

    Raises:
        InputError: a sample that is missing, not a number, or whose time does not ascend.
    """
    names = list(record.channels)
    channels = {name: ChannelScan() for name in names}
    collector = WindowCollector(record, names)
    for block in record.chunks(names):
        collector.feed(block)
        for name in names:
            channels[name].feed(block[name])
    for channel in channels.values():
        channel.close()
    return RecordScan(record, collector.finish(), channels, record.clock)
