"""A series later by any number of samples, whole or not."""

from __future__ import annotations

import numpy as np

from picchio.core.arrays import FloatArray

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
    found: FloatArray = full[first : first + series.size]
    return found


def shift_smooth(series: FloatArray, late: float) -> FloatArray:
    """The same for a smooth series whose small changes count: a cubic spline."""
    from scipy.interpolate import CubicSpline

    t = np.arange(series.size, dtype=np.float64)
    found: FloatArray = CubicSpline(t, series)(np.clip(t - late, 0.0, t[-1]))
    return found
