"""What a simulation leaves of measured channels, in numbers: by record, frequency, time, level.

All of it is arithmetic on residuals that others have computed. "Whitened" means divided by the
noise, so that noise alone has a power of 1 at every frequency.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np

from picchio.core.arrays import FloatArray


@dataclass(frozen=True)
class ChannelResidual:
    """One channel of one record.

    Attributes:
        record, channel, group: names.
        pose: number of the pose, from 0.
        direction: (3,) of the blows, world.
        level: N, height of the blows.
        taken, temperature: when, and deg C; None where not known.
        residual: RMS, SI.
        signal: RMS of the measurement, SI; of position channels about their mean.
        noise: standard deviation, SI.
        times: RMS of the whitened residual: 1 where it is noise.
    """

    record: str
    channel: str
    group: str
    pose: int
    direction: tuple[float, ...]
    level: float
    taken: datetime | None
    temperature: float | None
    residual: float
    signal: float
    noise: float
    times: float

    @property
    def nrmse(self) -> float:
        """Residual over signal."""
        return self.residual / self.signal if self.signal > 0.0 else math.nan

    @property
    def above_noise(self) -> float:
        """Share of the residual's power that noise does not account for, 0 to 1."""
        return max(0.0, 1.0 - 1.0 / self.times**2) if self.times > 0.0 else 0.0


@dataclass(frozen=True)
class Together:
    """Several channels as one.

    Attributes:
        nrmse: RMS of the residuals over that of the signals, each in units of its noise.
        floor: what noise alone would leave.
        times: RMS of the whitened residuals.
    """

    nrmse: float
    floor: float
    times: float

    @property
    def above_noise(self) -> float:
        """Share of the residual's power above the noise, 0 to 1."""
        return max(0.0, 1.0 - 1.0 / self.times**2) if self.times > 0.0 else 0.0


def together(parts: Iterable[ChannelResidual]) -> Together:
    """Channels of different units as one, each weighed by its noise."""
    rows = [p for p in parts if p.noise > 0.0]
    if not rows:
        return Together(math.nan, math.nan, math.nan)
    signal = sum((p.signal / p.noise) ** 2 for p in rows)
    residual = sum((p.residual / p.noise) ** 2 for p in rows)
    times = math.sqrt(sum(p.times**2 for p in rows) / len(rows))
    if signal <= 0.0:
        return Together(math.nan, math.nan, times)
    return Together(math.sqrt(residual / signal), math.sqrt(len(rows) / signal), times)


def spectrum(white: Sequence[FloatArray], step: float, edges: FloatArray) -> FloatArray:
    """Power of whitened residuals by band, 1 where it is noise.

    Args:
        white: (m,) each, of one step.
        step: s.
        edges: (k + 1,) Hz of the bands.

    Returns:
        (k,) mean power; NaN where no frequency of the records falls in.
    """
    total, count = np.zeros(edges.size - 1), np.zeros(edges.size - 1)
    for row in white:
        power = np.abs(np.fft.rfft(row)) ** 2 / row.size
        frequency = np.fft.rfftfreq(row.size, step)
        place = np.searchsorted(edges, frequency[1:], side="right") - 1
        inside = (place >= 0) & (place < total.size)
        np.add.at(total, place[inside], power[1:][inside])
        np.add.at(count, place[inside], 1.0)
    return np.where(count > 0.0, total / np.maximum(count, 1.0), np.nan)


def by_window(
    times: Sequence[FloatArray], rows: Sequence[FloatArray], edges: FloatArray
) -> FloatArray:
    """RMS over all rows in each window of time.

    Args:
        times: (m,) s, of each row.
        rows: (m,) each.
        edges: (k + 1,) s.

    Returns:
        (k,); NaN where a window has no sample.
    """
    total, count = np.zeros(edges.size - 1), np.zeros(edges.size - 1)
    for time, row in zip(times, rows, strict=True):
        place = np.searchsorted(edges, time + 1e-9, side="right") - 1
        inside = (place >= 0) & (place < total.size)
        np.add.at(total, place[inside], row[inside] ** 2)
        np.add.at(count, place[inside], 1.0)
    return np.where(count > 0.0, np.sqrt(total / np.maximum(count, 1.0)), np.nan)


def growth_with_level(parts: Sequence[ChannelResidual]) -> tuple[float, float] | None:
    """How the residual above the noise grows with the blows' height, as a power of it.

    1 is an error that scales with the force, as a linear model's does; 0 one that does not grow,
    as friction's or a clearance's; 2 or more a spring that hardens.

    Returns:
        the exponent and its standard error; None with fewer than four records that stand out
        of the noise, or levels that hardly differ.
    """
    groups: dict[str, list[ChannelResidual]] = {}
    for part in parts:
        groups.setdefault(part.record, []).append(part)
    x, y = [], []
    for rows in groups.values():
        whole = together(rows)
        excess = whole.times**2 - 1.0
        if excess > 1.0 and whole.nrmse > 0.0 and rows[0].level > 0.0:
            x.append(math.log(rows[0].level))
            y.append(0.5 * math.log(max(whole.nrmse**2 - whole.floor**2, 1e-300)))
    if len(x) < 4 or np.ptp(x) < 0.3:
        return None
    a = np.stack([np.asarray(x) - np.mean(x), np.ones(len(x))], axis=1)
    found, *_ = np.linalg.lstsq(a, np.asarray(y), rcond=None)
    left = np.asarray(y) - a @ found
    error = math.sqrt(float(left @ left) / (len(x) - 2) / float(a[:, 0] @ a[:, 0]))
    return 1.0 + float(found[0]), error
