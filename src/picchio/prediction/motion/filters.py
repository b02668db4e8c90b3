"""Low-pass filters without phase, and derivatives, as identification practice has them.

Measured angles are low-passed forwards and backwards (fourth-order Butterworth, so nothing is
delayed), then differentiated by central differences. Measured torques, and those terms of the
prediction that jump, go through the same filter, so that both sides of the equation of motion
have lost the same (the parallel filter of M. Gautier, "Dynamic identification of robots with power
model", ICRA 1997; A. Janot, P.-O. Vandanjon, M. Gautier, IEEE Trans. Control Systems Technology
22(1), 2014).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError

# A series later by any number of samples, whole or not.

_TAPS = 8


def shift(series: FloatArray, late: float) -> FloatArray:
    """The series, later by `late` samples, by a windowed sinc; its ends are continued straight."""
    whole = int(np.floor(late))
    taps = np.arange(1 - _TAPS, _TAPS + 1)
    distance = taps - (late - whole)
    kernel = np.sinc(distance) * np.cos(0.5 * np.pi * distance / (_TAPS + 1)) ** 2
    kernel /= kernel.sum()
    pad = _TAPS + abs(whole)
    ramp = np.arange(1, pad + 1)
    start = series[0] - (series[1] - series[0]) * ramp[::-1]
    end = series[-1] + (series[-1] - series[-2]) * ramp
    padded = np.concatenate([start, series, end])
    # out[i] = sum_k kernel[k] series[i - whole - taps[k]]
    full = np.convolve(padded, kernel)
    first = pad + _TAPS - 1 - whole
    return np.asarray(full[first : first + series.size])


def shift_smooth(series: FloatArray, late: float) -> FloatArray:
    """The same for a smooth series whose small changes count: a cubic spline."""
    from scipy.interpolate import CubicSpline

    t = np.arange(series.size, dtype=np.float64)
    return np.asarray(CubicSpline(t, series)(np.clip(t - late, 0.0, t[-1])))


_ORDER = 4
_HIGHEST = 0.4  # of the sampling rate
_SAMPLES_PER_CUTOFF = 3.0
_FEWEST_PERIODS = 20.0
_PERIODS = 3.0  # of the cut-off, that the ends of a record spoil


@dataclass(frozen=True)
class Band:
    """The band in which motion and torque are compared.

    Attributes:
        cutoff: Hz.
        rate: samples a second, Hz.
    """

    cutoff: float
    rate: float

    @cached_property
    def _sections(self) -> FloatArray:
        from scipy.signal import butter

        return np.asarray(butter(_ORDER, self.cutoff, fs=self.rate, output="sos"))

    @cached_property
    def _steady(self) -> FloatArray:
        from scipy.signal import sosfilt_zi

        return np.asarray(sosfilt_zi(self._sections))

    @property
    def step(self) -> int:
        """Every so many samples carry all that is left after the filter."""
        return max(1, int(self.rate / (_SAMPLES_PER_CUTOFF * self.cutoff)))

    def edges(self, samples: int) -> int:
        """So many samples at either end of a record are left out: they feel that it ends.

        Three periods of the cut-off where that costs a sixteenth or less; one in any case.
        """
        period = int(np.ceil(self.rate / self.cutoff))
        return min(self.edge, max(period, samples // 16), samples // 8)

    @property
    def edge(self) -> int:
        """So many samples at either end feel where the record begins and ends."""
        return int(np.ceil(_PERIODS * self.rate / self.cutoff))

    def low_pass(self, series: FloatArray) -> FloatArray:
        """(..., m) without what is faster than the cut-off; no phase."""
        from scipy.signal import sosfilt

        # The ends are continued point-symmetrically.
        pad = min(self.edge, series.shape[-1] - 1)
        start = 2.0 * series[..., :1] - series[..., pad:0:-1]
        end = 2.0 * series[..., -1:] - series[..., -2 : -pad - 2 : -1]
        x = np.concatenate([start, series, end], axis=-1)
        for _ in range(2):
            steady = self._steady.reshape(-1, *[1] * (x.ndim - 1), 2) * x[..., :1]
            x = sosfilt(self._sections, x, axis=-1, zi=steady)[0][..., ::-1]
        return np.asarray(x[..., pad : pad + series.shape[-1]])

    def differentiate(self, series: FloatArray) -> FloatArray:
        """(..., m) central differences."""
        return np.asarray(np.gradient(series, 1.0 / self.rate, axis=-1))


def choose_cutoff(angles: Sequence[tuple[FloatArray, float]]) -> float:
    """Where to cut: an octave below the frequency from which accelerations are noise.

    The acceleration's spectrum first falls with the motion's, then rises with the fourth power
    of the frequency times the encoder's noise. The bottom between the two is looked for in every
    series; the median counts. The shortest record shall hold twenty periods of the cut-off.

    Args:
        angles: (m,) rad or m of joints that move, each with its rate in Hz.

    Returns:
        Hz.
    """
    if not angles:
        raise InputError("no joint moves in the records to be fitted to")
    bottom = float(np.median([_bottom(series, rate) for series, rate in angles]))
    shortest = min(series.size / rate for series, rate in angles)
    highest = _HIGHEST * min(rate for _, rate in angles)
    return float(min(max(0.5 * bottom, _FEWEST_PERIODS / shortest), highest))


def _bottom(series: FloatArray, rate: float) -> float:
    from scipy.signal import welch

    straight = series - np.linspace(series[0], series[-1], series.size)
    frequency, power = welch(straight, rate, nperseg=min(1024, series.size))
    power = power[1:] * frequency[1:] ** 4
    # A third of an octave is averaged: lines of a ripple or hum are no bottom.
    f = frequency[1:]
    first, last = np.searchsorted(f, f / 1.15), np.searchsorted(f, f * 1.15, side="right")
    smooth = [np.median(power[a:b]) for a, b in zip(first, last, strict=True)]
    return float(f[int(np.argmin(smooth))])
