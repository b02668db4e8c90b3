"""The first part of a record, as much as fits in memory, and where in it nothing should move."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from picchio.campaign.channels import TIME, Channel
from picchio.campaign.record import Record
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.excitation.excitation import Excitation

# Numbers kept of one record, all channels together: 16 MiB.
LIMIT = 1 << 21


@dataclass(frozen=True, eq=False)
class Window:
    """The first samples of a record, as many as are kept.

    Attributes:
        record: whose.
        time: (m,) s.
        arrays: {channel: (m,)} SI.
        complete: False where the record is longer.
        rate: samples a second, Hz.
    """

    record: Record
    time: FloatArray
    arrays: dict[str, FloatArray] = field(repr=False)
    complete: bool
    rate: float

    @cached_property
    def channels(self) -> dict[str, Channel]:
        """The channels of `arrays`, by name."""
        return {name: self.record.channel(name) for name in self.arrays}

    @cached_property
    def groups(self) -> dict[str, list[Channel]]:
        """The same by channel group."""
        found: dict[str, list[Channel]] = {}
        for channel in self.channels.values():
            found.setdefault(channel.group, []).append(channel)
        return found

    @property
    def step(self) -> float:
        """s, between two samples."""
        return 1.0 / self.rate

    @property
    def blows(self) -> Excitation | None:
        """The programmed blows; None where there are none, or they cannot be made."""
        try:
            return self.record.blows()
        except InputError:
            return None

    @property
    def steady(self) -> bool:
        """A percussion record whose blows never end."""
        return self.record.steady

    @property
    def burst_end(self) -> float | None:
        """s, a whole period after the last blow began; None without a burst that is known."""
        blows, hits = self.blows, self.record.hits
        return None if blows is None or hits is None else hits * blows.period

    def quiet(self) -> slice:
        """The samples before the first blow, the last one of them left out."""
        if self.record.kind != "percussion" or self.steady:
            return slice(0, 0)
        return slice(0, max(0, int(np.searchsorted(self.time, -0.5 * self.step)) - 1))

    def after(self) -> slice:
        """The samples after the burst."""
        if self.burst_end is None:
            return slice(0, 0)
        return slice(int(np.searchsorted(self.time, self.burst_end)), self.time.size)


def read_window(record: Record) -> Window:
    """Read the first samples of a record.

    Raises:
        InputError: as `Record.chunks`.
    """
    names = list(record.channels)
    collector = WindowCollector(record, names)
    for block in record.chunks(names):
        if not collector.feed(block):
            break
    return collector.finish()


class WindowCollector:
    """Keeps the first blocks of a record, up to a limit."""

    def __init__(self, record: Record, names: list[str]) -> None:
        self.record, self.names = record, names
        self.most = max(4096, LIMIT // (len(names) + 1))
        self._blocks: list[dict[str, FloatArray]] = []
        self._samples = 0
        self._complete = True

    def feed(self, block: dict[str, FloatArray]) -> bool:
        """Take the next block; False once no more is wanted."""
        room = self.most - self._samples
        if room < block[TIME].size:
            self._complete = False
        if room > 0:
            self._blocks.append({name: values[:room] for name, values in block.items()})
            self._samples += self._blocks[-1][TIME].size
        return room > block[TIME].size

    def finish(self) -> Window:
        """The window.

        Raises:
            InputError: fewer than two samples.
        """
        if self._samples < 2:
            raise self.record.source.error("holds fewer than two samples")
        joined = {n: np.concatenate([b[n] for b in self._blocks]) for n in (TIME, *self.names)}
        time = joined.pop(TIME)
        rate = (time.size - 1) / float(time[-1] - time[0])
        return Window(self.record, time, joined, self._complete, rate)
