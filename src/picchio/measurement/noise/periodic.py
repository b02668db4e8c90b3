"""Noise from a periodic response: what is not periodic in it; no model is needed.

Every sample is predicted from the samples of *other* periods that lie nearest in phase, so nothing
is asked of the response but that it repeats: it may jump, and the period need not be a whole
number of samples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import FloatArray

_NEIGHBOURS = 6
_SIGMAS = 6.0
# The programmed period is looked for within this share of itself.
_REACH = 0.06


@dataclass(frozen=True, eq=False)
class NotPeriodic:
    """The part of a series that does not repeat.

    Attributes:
        residual: (m,) scaled such that its variance is the noise's.
        scale: (m,) by which the difference from the prediction was divided.
        used: (m,) False at jumps, where neighbours in phase stand on both sides of an edge.
    """

    residual: FloatArray
    scale: FloatArray
    used: FloatArray

    @property
    def std(self) -> float:
        """Standard deviation of the noise."""
        kept = self.residual[self.used]
        return float(np.sqrt(np.mean(kept**2))) if kept.size else float("nan")


def not_periodic(time: FloatArray, series: FloatArray, period: float) -> NotPeriodic | None:
    """The part of a series that does not repeat with a period; None below three periods.

    Args:
        time: (m,) s, even.
        series: (m,).
        period: s.
    """
    m = time.size
    periods = (time[-1] - time[0]) / period
    if periods < 2.5 or m < 24:
        return None
    phase = np.mod(time - time[0], period)
    order = np.argsort(phase, kind="stable")
    sorted_phase, sorted_series = phase[order], series[order]
    reach = min(int(np.ceil(periods)) + 1, 16, (m - 1) // 2)
    shifts = np.concatenate([np.arange(-reach, 0), np.arange(1, reach + 1)])
    index = np.arange(m)[:, None] + shifts
    away = sorted_phase[index % m] + period * (index // m) - sorted_phase[:, None]
    # Neighbours in phase that are neighbours in time would share its noise.
    distance = np.abs(away)
    same_period = np.abs(time[order][index % m] - time[order][:, None]) < 0.5 * period
    distance[same_period] = np.inf
    count = min(_NEIGHBOURS, shifts.size)
    nearest = np.argpartition(distance, count - 1, axis=1)[:, :count]
    offset = np.take_along_axis(away, nearest, axis=1)
    found = np.isfinite(np.take_along_axis(distance, nearest, axis=1))
    index = np.take_along_axis(index, nearest, axis=1) % m
    values = sorted_series[index]
    # Samples unlike the mean of their neighbours are next to a jump: they predict nothing.
    rough = sorted_series - np.nanmedian(np.where(found, values, np.nan), axis=1)
    limit = _SIGMAS * 1.4826 * float(np.nanmedian(np.abs(rough)))
    odd = np.abs(rough) > limit if limit > 0.0 else np.zeros(m, bool)
    found &= ~odd[index]
    weights = _local_line(offset, found, time[1] - time[0])
    scale = np.sqrt(1.0 + (weights**2).sum(axis=1))
    left = (sorted_series - (weights * values).sum(axis=1)) / scale
    usable = ~odd & (found.sum(axis=1) >= 2)
    spread = 1.4826 * np.median(np.abs(left[usable])) if usable.any() else 0.0
    usable &= np.abs(left) <= _SIGMAS * spread if spread > 0.0 else True
    left = np.where(usable, left, 0.0)
    back = np.empty(m, dtype=np.intp)
    back[order] = np.arange(m)
    return NotPeriodic(left[back], scale[back], usable[back])


def _local_line(offset: FloatArray, found: FloatArray, step: float) -> FloatArray:
    """(m, k) weights whose sum with the neighbours is the value at offset zero of a line."""
    w = found.astype(float)
    total = np.maximum(w.sum(axis=1, keepdims=True), 1.0)
    mean = (w * offset).sum(axis=1, keepdims=True) / total
    spread = (w * (offset - mean) ** 2).sum(axis=1, keepdims=True)
    # Neighbours that all lie at one phase have no slope, and those on one side would extrapolate.
    tilt = np.where(spread > 1e-6 * step**2, -mean / np.where(spread > 0.0, spread, 1.0), 0.0)
    tilt = np.clip(tilt * step, -0.5, 0.5) / step
    return w * (1.0 / total + tilt * (offset - mean))


def find_period(time: FloatArray, series: FloatArray, programmed: float) -> float:
    """The period near the programmed one with which a series repeats best, s.

    Found from the power at the first harmonics, then on the part that does not repeat.
    """
    length = float(time[-1] - time[0])
    if length < 2.5 * programmed:
        return programmed
    x = series - series.mean()
    stride = max(1, time.size // 20000)
    x, t = x[::stride], time[::stride]
    harmonics = np.arange(1, 9)
    harmonics = harmonics[harmonics / programmed < 0.4 / (t[1] - t[0])]
    if not harmonics.size:
        return programmed
    # The top harmonic must not slip by more than a tenth of a turn between two trials.
    step = 0.1 * programmed**2 / (length * harmonics[-1])
    trials = programmed + step * np.arange(-int(_REACH * programmed / step),
                                           int(_REACH * programmed / step) + 1)  # fmt: skip
    tapered = np.hanning(x.size) * x
    power = np.zeros(trials.size)
    for first in range(0, trials.size, 256):
        turn = np.exp(-2j * np.pi * np.outer(1.0 / trials[first : first + 256], t))
        wave = np.ones_like(turn)
        for _ in harmonics:  # each turns once more than the last
            wave *= turn
            power[first : first + 256] += np.abs(wave @ tapered) ** 2
    best = float(trials[power.argmax()])
    return _refined(t, x, harmonics, best, step)


def _refined(t: FloatArray, x: FloatArray, harmonics: FloatArray, period: float,
             step: float) -> float:  # fmt: skip
    from scipy.optimize import minimize_scalar

    def left(trial: float) -> float:
        angle = 2.0 * np.pi * np.outer(t / trial, harmonics)
        basis = np.column_stack([np.ones(t.size), np.cos(angle), np.sin(angle)])
        fit, *_ = np.linalg.lstsq(basis, x, rcond=None)
        return float(((x - basis @ fit) ** 2).sum())

    found = minimize_scalar(left, bounds=(period - 3 * step, period + 3 * step), method="bounded",
                            options={"xatol": 1e-4 * step})  # fmt: skip
    return float(found.x)
