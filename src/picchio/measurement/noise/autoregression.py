"""Coloured noise as an autoregression: a spectrum, a whitening filter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError

MAX_ORDER = 24


@dataclass(frozen=True, eq=False)
class AutoRegression:
    """x[i] = sum_k a[k] x[i-1-k] + e[i], e white: stable, whatever its parameters.

    Attributes:
        reflection: (p,) the partial correlations, each within -1 and 1; none is white noise.
        variance: of x.
    """

    reflection: FloatArray
    variance: float

    def __post_init__(self) -> None:
        frozen = np.array(self.reflection, dtype=np.float64)
        frozen.setflags(write=False)
        object.__setattr__(self, "reflection", frozen)

    @property
    def order(self) -> int:
        """How many samples back it looks."""
        return int(self.reflection.size)

    @cached_property
    def predictors(self) -> list[FloatArray]:
        """The best predictor from k samples back, for k = 0 to the order (Levinson)."""
        found = [np.zeros(0)]
        for k in self.reflection:
            last = found[-1]
            found.append(np.append(last - k * last[::-1], k))
        return found

    @cached_property
    def variances(self) -> FloatArray:
        """(p + 1,) what each predictor leaves."""
        left = np.cumprod(np.append(1.0, 1.0 - self.reflection**2))
        return self.variance * left

    def whiten(self, series: ArrayLike) -> FloatArray:
        """The series with its colour taken out: independent, of unit variance if it is this noise.

        Exact from the first sample on: before `order` samples are known, those known are used.

        Args:
            series: (..., m).

        Raises:
            InputError: noise without variance.
        """
        from picchio.measurement.noise.whiten_kernel import whiten as kernel

        x = np.ascontiguousarray(series, dtype=np.float64)
        if not self.variance > 0.0:
            raise InputError("noise without variance cannot whiten")
        out = np.empty_like(x)
        table, deviation = self.filters
        for row, clean in zip(
            x.reshape(-1, x.shape[-1]), out.reshape(-1, x.shape[-1]), strict=True
        ):
            kernel(row, table, deviation, clean)
        return out

    @cached_property
    def filters(self) -> tuple[FloatArray, FloatArray]:
        """(p + 1, p) predictors, a row for each number of samples known; (p + 1,) their errors."""
        table = np.zeros((self.order + 1, self.order))
        for row, predictor in zip(table, self.predictors, strict=True):
            row[: predictor.size] = predictor
        return table, np.sqrt(self.variances)

    def psd(self, frequency: ArrayLike, rate: float) -> FloatArray:
        """One-sided power spectral density, unit^2/Hz, at frequencies in Hz.

        Args:
            frequency: (k,) Hz.
            rate: samples a second, Hz.

        Returns:
            (k,) of it.
        """
        f = np.asarray(frequency, dtype=np.float64)
        lags = np.arange(1, self.order + 1)
        wave = np.exp(-2j * np.pi * f[..., None] * lags / rate)
        gain = 1.0 - wave @ self.predictors[-1]
        return 2.0 * self.variances[-1] / rate / np.abs(gain) ** 2

    def autocorrelation(self, lags: int) -> FloatArray:
        """The autocorrelation (lags + 1,), from 1 at lag zero on.

        Args:
            lags: the last one.
        """
        from scipy.signal import lfilter, lfiltic

        rho, left = np.ones(1), np.cumprod(np.append(1.0, 1.0 - self.reflection**2))
        for k, (a, reflection) in enumerate(zip(self.predictors, self.reflection, strict=False)):
            rho = np.append(rho, a @ rho[:0:-1] + reflection * left[k])
        last = np.append(1.0, -self.predictors[-1])
        more = max(lags - self.order, 0)
        if more and self.order:
            rest = lfilter([1.0], last, np.zeros(more), zi=lfiltic([1.0], last, rho[:0:-1]))[0]
        else:
            rest = np.zeros(more)
        return np.append(rho, rest)[: lags + 1]


def fit_autoregression(
    pieces: Sequence[FloatArray], max_order: int = MAX_ORDER, *, mean_removed: Sequence[bool] = ()
) -> AutoRegression:
    """The autoregression of pieces of one noise, by Burg's method over all of them.

    The order is the one that Schwarz' criterion (BIC) prefers.

    Args:
        pieces: (m_i,) each.
        max_order: the most samples back; fewer where the pieces are short.
        mean_removed: which pieces had their mean removed: the variance that went with it, which
            is large where noise is slow, is given back.

    Raises:
        InputError: no samples.
    """
    used = [np.asarray(piece, dtype=np.float64) for piece in pieces if len(piece)]
    samples = sum(piece.size for piece in used)
    if not samples:
        raise InputError("there are no samples to estimate noise from")
    power = sum(float(piece @ piece) for piece in used) / samples
    if power == 0.0:
        return AutoRegression(np.zeros(0), 0.0)
    longest = max(piece.size for piece in used)
    highest = min(max_order, longest // 4, samples // 8)
    forward, backward = [p.copy() for p in used], [p.copy() for p in used]
    reflection: list[float] = []
    best, best_order, left = samples * np.log(power), 0, power
    for order in range(1, highest + 1):
        pairs = [(f[1:], b[:-1]) for f, b in zip(forward, backward, strict=True) if f.size > 1]
        below = sum(float(f @ f + b @ b) for f, b in pairs)
        if below <= 0.0:
            break
        k = 2.0 * sum(float(f @ b) for f, b in pairs) / below
        k = float(np.clip(k, -1.0 + 1e-9, 1.0 - 1e-9))
        forward, backward = [f - k * b for f, b in pairs], [b - k * f for f, b in pairs]
        reflection.append(k)
        left *= 1.0 - k * k
        criterion = samples * np.log(left) + order * np.log(samples)
        if criterion < best:
            best, best_order = criterion, order
    found = AutoRegression(np.array(reflection[:best_order]), power)
    if any(mean_removed):
        gone = sum(
            len(piece) * _variance_of_mean(found, len(piece))
            for piece, removed in zip(pieces, mean_removed, strict=True)
            if removed and len(piece)
        )
        found = AutoRegression(found.reflection, power * samples / max(samples - gone, 1.0))
    return found


def _variance_of_mean(noise: AutoRegression, samples: int) -> float:
    """Of the mean of so many samples, over the variance of one."""
    rho = noise.autocorrelation(min(samples - 1, 4096)) if samples > 1 else np.ones(1)
    weights = 1.0 - np.arange(rho.size) / samples
    return float(np.clip((2.0 * (weights * rho).sum() - 1.0) / samples, 0.0, 0.9))


def relative_error(noise: AutoRegression, samples: float) -> float:
    """Standard error of the standard deviation, over itself, from so many samples."""
    if samples <= 1.0:
        return float("inf")
    rho = noise.autocorrelation(int(min(samples, 2048)))
    return float(np.sqrt((2.0 * (rho**2).sum() - 1.0) / (2.0 * samples)))
