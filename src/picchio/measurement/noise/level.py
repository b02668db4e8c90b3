"""The estimated noise of one channel."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.measurement.noise.autoregression import AutoRegression
from picchio.measurement.noise.hum import Line


@dataclass(frozen=True)
class NoiseSource:
    """One estimate of the noise.

    Attributes:
        method: a key of `picchio.measurement.noise.pieces.METHODS`.
        std: in the channel's unit, hum removed.
        error: relative standard error of `std`.
        records: how many records contributed.
        used: whether the level and the spectrum were taken from it; a source that sees clearly
            more than a surer one is not (repeats that differ, a ring-down that is not linear).
    """

    method: str
    std: float
    error: float
    records: int
    used: bool


@dataclass(frozen=True, eq=False)
class Noise:
    """The noise of one channel.

    Attributes:
        channel: its name.
        unit: SI.
        rate: samples a second, Hz, that `model` and the spectrum are for.
        std: standard deviation, without hum.
        error: relative standard error of `std`.
        model: the noise as an autoregression.
        hum: the mains and its harmonics, where found.
        resolution: the smallest step of the channel's values; 0 where there is none to see.
        sources: what each way of looking at it says.
        rough: True where there are motion records alone: a floor rather than a level.
        others: the same at other sample rates, by Hz.
    """

    channel: str
    unit: str
    rate: float
    std: float
    error: float
    model: AutoRegression = field(repr=False)
    hum: tuple[Line, ...] = ()
    resolution: float = 0.0
    sources: tuple[NoiseSource, ...] = ()
    rough: bool = False
    others: dict[float, Noise] = field(default_factory=dict, repr=False)

    @property
    def white(self) -> bool:
        """True where no colour was found."""
        return self.model.order == 0

    @property
    def frequency(self) -> FloatArray:
        """(129,) Hz, of `psd`."""
        return np.linspace(0.0, 0.5 * self.rate, 129)

    @property
    def psd(self) -> FloatArray:
        """(129,) one-sided power spectral density, unit^2/Hz, without hum."""
        return self.model.psd(self.frequency, self.rate)

    def at(self, rate: float) -> Noise:
        """The noise at another sample rate: measured there if it was, else white of this level.

        Args:
            rate: samples a second, Hz.
        """
        for other, noise in {self.rate: self, **self.others}.items():
            if abs(other / rate - 1.0) < 1e-3:
                return noise
        white = AutoRegression(np.zeros(0), self.std**2)
        return replace(self, rate=rate, model=white, others={})

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "channel": self.channel,
            "unit": self.unit,
            "sample_rate": self.rate,
            "std": self.std,
            "relative_error": self.error,
            "white": self.white,
            "rough": self.rough,
            "resolution": self.resolution,
            "hum": [{"frequency": h.frequency, "amplitude": h.amplitude} for h in self.hum],
            "spectrum": {"frequency": self.frequency[::8], "psd": self.psd[::8]},
            "sources": [
                {"method": s.method, "std": s.std, "relative_error": s.error,
                 "records": s.records, "used": s.used}
                for s in self.sources
            ],
        }  # fmt: skip
