"""One record to be explained."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from picchio.campaign.channels import Channel
from picchio.core.arrays import BoolArray, FloatArray
from picchio.core.recent import Recent
from picchio.measurement.noise.level import Noise
from picchio.prediction.percussion import PercussionSetup

_KEPT_EDGES = 8


@dataclass(frozen=True, eq=False)
class MeasuredRecord:
    """One record to be explained.

    Attributes:
        setup: what is needed to predict it.
        values: channel -> (m,) SI.
        noise: channel -> its noise at the record's rate.
        pose: number of its pose among the campaign's.
    """

    setup: PercussionSetup
    values: Mapping[str, FloatArray]
    noise: Mapping[str, Noise]
    pose: int
    _cuts: dict[float, PercussionSetup] = field(default_factory=dict)
    _edges: Recent[dict[str, BoolArray] | None] = field(default_factory=lambda: Recent(_KEPT_EDGES))
    _fillers: dict[str, FloatArray] = field(default_factory=dict)
    _pinned: list[dict[str, BoolArray] | None] = field(default_factory=list)

    @property
    def name(self) -> str:
        """Its file."""
        return self.setup.name

    @cached_property
    def channels(self) -> list[Channel]:
        """The channels of `values`, in their order."""
        known = {channel.name: channel for channel in self.setup.channels}
        return [known[name] for name in self.values]

    def filler(self, channel: str) -> FloatArray:
        """(m,) of +-1 without a pattern, always the same: in place of what is not known.

        Args:
            channel: its name.
        """
        if channel not in self._fillers:
            seed = zlib.crc32(f"{self.name}/{channel}".encode())
            signs = np.random.default_rng(seed).integers(0, 2, self.setup.samples.count)
            self._fillers[channel] = 2.0 * signs - 1.0
        return self._fillers[channel]

    def until(self, end: float | None) -> PercussionSetup:
        """The setup up to a time, s.

        Args:
            end: s; None for all of the record.
        """
        if end is None or end >= self.setup.samples.last:
            return self.setup
        if end not in self._cuts:
            self._cuts[end] = self.setup.cut(end)
        return self._cuts[end]
