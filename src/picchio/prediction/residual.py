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
from numpy.typing import NDArray

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError

# Residuals as an engineer looks for causes in them: as joint torques, and as transfer functions.
#
# Sources: restoring-force surfaces, Masri and Caughey, J. Appl. Mech. 46 (1979); the H1 estimator,
# Bendat and Piersol, Random Data (2010), ch. 6.

# Of the highest natural frequency: what lies above is noise made large by differentiation.
_KEPT = 2.5
_SEGMENT = 0.6  # s
_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class Restoring:
    """A joint's torque that the model does not have, beside the joint's motion.

    Attributes:
        deflection: (m,) rad or m, as measured.
        velocity: (m,) 1/s of it.
        torque: (m,) N m or N: what would have to act on the model for it to move as measured.
    """

    deflection: FloatArray
    velocity: FloatArray
    torque: FloatArray


def residual_torque(
    mass: FloatArray,
    damping: FloatArray,
    stiffness: FloatArray,
    measured: FloatArray,
    predicted: FloatArray,
    step: float,
) -> list[Restoring]:
    """The generalised torque that makes up for the difference of two motions of a linear model.

    With e = measured - predicted it is M e'' + C e' + K e, derivatives by differences after a
    zero-phase low-pass above the highest natural frequency. The edges of the record are left out.

    Args:
        mass: (n, n).
        damping: (n, n).
        stiffness: (n, n).
        measured: (n, m) rad or m.
        predicted: (n, m) rad or m.
        step: s.

    Returns:
        one a joint.

    Raises:
        InputError: fewer than 64 samples.
    """
    from scipy.signal import butter, sosfiltfilt

    if measured.shape[1] < 64:
        raise InputError("too short a record to differentiate", value=measured.shape[1])
    squared = np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real
    highest = float(np.sqrt(max(squared.max(), 0.0))) / (2.0 * np.pi)
    corner = min(_KEPT * highest * step * 2.0, 0.8)
    low = butter(4, corner, output="sos")
    smooth = sosfiltfilt(low, measured, axis=1)
    e = sosfiltfilt(low, measured - predicted, axis=1)
    rate, e1 = np.gradient(smooth, step, axis=1), np.gradient(e, step, axis=1)
    torque = mass @ np.gradient(e1, step, axis=1) + damping @ e1 + stiffness @ e
    edge = min(int(1.5 / corner) + 2, measured.shape[1] // 8)
    kept = slice(edge, -edge)
    return [
        Restoring(x[kept], v[kept], t[kept]) for x, v, t in zip(smooth, rate, torque, strict=True)
    ]


@dataclass(frozen=True, eq=False)
class Transfer:
    """Response over force.

    Attributes:
        frequency: (k,) Hz.
        measured, simulated: (k,) complex, SI a newton.
        coherence: (k,) of the measurement, 0 to 1.
    """

    frequency: FloatArray
    measured: NDArray[np.complex128]
    simulated: NDArray[np.complex128]
    coherence: FloatArray


def transfer(
    force: Sequence[FloatArray],
    measured: Sequence[FloatArray],
    simulated: Sequence[FloatArray],
    step: float,
) -> Transfer:
    """H1 of several records together, the simulation through the same estimator.

    Two or more records are averaged whole: each begins at rest and has rung down, so no window
    is needed. A single one is cut into overlapping windows.

    Args:
        force: (m,) N each, as measured.
        measured: (m,) SI each.
        simulated: (m,) SI each.
        step: s.
    """
    from scipy.signal import csd, welch

    shortest = min(row.size for row in force)
    if len(force) > 1:
        options = {"window": "boxcar", "nperseg": shortest, "noverlap": 0, "detrend": False}
    else:
        size = max(min(int(_SEGMENT / step), shortest // 2), 16)
        options = {"nperseg": size, "noverlap": (3 * size) // 4, "detrend": "constant"}
    options["fs"] = 1.0 / step
    sums: list[NDArray[np.complex128]] = []
    frequency = np.zeros(0)
    for rows in zip(force, measured, simulated, strict=True):
        f, y, s = (row[:shortest] for row in rows)
        frequency, ff = welch(f, **options)
        parts = [ff, welch(y, **options)[1], csd(f, y, **options)[1], csd(f, s, **options)[1]]
        sums = [a + p for a, p in zip(sums, parts, strict=True)] if sums else parts
    power, response = np.maximum(sums[0].real, _TINY), np.maximum(sums[1].real, _TINY)
    coherence = np.abs(sums[2]) ** 2 / (power * response)
    return Transfer(frequency, sums[2] / power, sums[3] / power, np.clip(coherence, 0.0, 1.0))


@dataclass(frozen=True)
class ChannelResidual:
    """One channel of one record.

    Attributes:
        record, channel, group: names.
        pose: number of the pose, from 0.
        direction: (3,) of the blows, world.
        level: N, peak force of the blows.
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
    frequencies = [np.fft.rfftfreq(row.size, step)[1:] for row in white]
    powers = [np.abs(np.fft.rfft(row)[1:]) ** 2 / row.size for row in white]
    return _binned(frequencies, powers, edges)


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
    return np.sqrt(_binned([time + 1e-9 for time in times], [row**2 for row in rows], edges))


def _binned(
    places: Sequence[FloatArray], values: Sequence[FloatArray], edges: FloatArray
) -> FloatArray:
    """(k,) mean of the values whose places lie between two edges; NaN where there is none."""
    total, count = np.zeros(edges.size - 1), np.zeros(edges.size - 1)
    for place, value in zip(places, values, strict=True):
        number = np.searchsorted(edges, place, side="right") - 1
        inside = (number >= 0) & (number < total.size)
        np.add.at(total, number[inside], value[inside])
        np.add.at(count, number[inside], 1.0)
    return np.where(count > 0.0, total / np.maximum(count, 1.0), np.nan)


def growth_with_level(parts: Sequence[ChannelResidual]) -> tuple[float, float] | None:
    """How the residual above the noise grows with the blows' height, as a power of it.

    1 is an error that scales with the force, as a linear model's does; 0 one that does not grow,
    as friction's or a clearance's; 2 or more a spring that hardens.

    Returns:
        the exponent and its standard error; None with fewer than four records that stand out
        of the noise, or levels that hardly differ.
    """
    from scipy.stats import linregress

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
    line = linregress(x, y)
    return 1.0 + float(line.slope), float(line.stderr)
