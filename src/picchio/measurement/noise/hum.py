"""Mains hum: a line at 50 or 60 Hz in the noise, estimated and removed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.measurement.noise.autoregression import AutoRegression, fit_autoregression
from picchio.measurement.noise.pieces import Piece
from picchio.measurement.noise.ringdown import MAINS

_FALSE_ALARMS = 1e-4
_ORDER = 8


@dataclass(frozen=True)
class Line:
    """A hum.

    Attributes:
        frequency: Hz.
        amplitude: in the channel's unit; the phase differs from record to record.
    """

    frequency: float
    amplitude: float


def take_out_hum(pieces: Sequence[Piece], rate: float) -> tuple[list[Piece], tuple[Line, ...]]:
    """The pieces without the mains, and the lines that were found.

    Each piece has its own phase. A line is found where the power that it takes, after whitening,
    would come about by chance in one campaign out of ten thousand.

    Args:
        pieces: of one channel and sample rate.
        rate: samples a second, Hz.
    """
    current, lines = list(pieces), []
    for mains in MAINS:
        found = _search(current, mains, rate)
        if found is None:
            continue
        lines.append(found)
        current = _without(current, found.frequency, rate)
        for harmonic in (2, 3):
            more = _search(current, harmonic * found.frequency, rate, reach=False)
            if more is not None:
                lines.append(more)
                current = _without(current, more.frequency, rate)
    return current, tuple(lines)


def _search(pieces: Sequence[Piece], nominal: float, rate: float, *,
            reach: bool = True) -> Line | None:  # fmt: skip
    from scipy.stats import chi2

    # At least two turns, or it cannot be told from a slope.
    used = [p for p in pieces if p.values.size > 2.0 * rate / nominal and p.values.any()]
    if not used or nominal > 0.45 * rate:
        return None
    clean = [p.values - _fitted(p, nominal, None) for p in used]
    noise = fit_autoregression(clean, _ORDER)
    if not noise.variance > 0.0:
        return None
    longest = max(p.values.size for p in used) / rate
    # The mains keeps within half a percent; finer than a fifth of a line's width is no use.
    count = int(np.clip(np.ceil(0.01 * nominal * longest * 5.0), 1, 41)) if reach else 1
    trials = nominal * (1.0 + (np.linspace(-0.005, 0.005, count) if count > 1 else np.zeros(1)))
    powers = [sum(_power(p, f, noise) for p in used) for f in trials]
    best = int(np.argmax(powers))
    independent = 1.0 + 0.01 * nominal * longest * (count > 1)
    probability = independent * float(chi2.sf(powers[best], 2 * len(used)))
    if probability > _FALSE_ALARMS:
        return None
    frequency = float(trials[best])
    weights = [p.values.size for p in used]
    squares = [2.0 * np.mean(_fitted(p, frequency, noise) ** 2) * p.gain**2 for p in used]
    # What noise alone would give is subtracted from the squares.
    extra = [4.0 * noise.psd(frequency, rate) * rate / 2.0 / p.values.size for p in used]
    amplitude = np.sqrt(max(float(np.average(np.subtract(squares, extra), weights=weights)), 0.0))
    return Line(frequency, float(amplitude))


def _basis(piece: Piece, frequency: float) -> FloatArray:
    angle = 2.0 * np.pi * frequency * piece.time
    return np.stack([np.cos(angle), np.sin(angle)])


def _fitted(piece: Piece, frequency: float, noise: AutoRegression | None) -> FloatArray:
    """(m,) the wave of this frequency that fits the piece best."""
    basis = _basis(piece, frequency)
    white, data = (basis, piece.values) if noise is None else (
        noise.whiten(basis), noise.whiten(piece.values)
    )  # fmt: skip
    fit, *_ = np.linalg.lstsq(white.T, data, rcond=None)
    return fit @ basis


def _power(piece: Piece, frequency: float, noise: AutoRegression) -> float:
    """How much the wave takes of the whitened piece's power; chi-square of 2 for noise alone."""
    white, data = noise.whiten(_basis(piece, frequency)), noise.whiten(piece.values)
    q, _ = np.linalg.qr(white.T)
    return float(((q.T @ data) ** 2).sum())


def _without(pieces: Sequence[Piece], frequency: float, rate: float) -> list[Piece]:
    result = []
    for piece in pieces:
        if (m := piece.values.size) <= 2.0 * rate / frequency:
            result.append(piece)
            continue
        left = (piece.values - _fitted(piece, frequency, None)) * np.sqrt(m / (m - 2.0))
        result.append(replace(piece, values=left, samples=piece.samples - 2))
    return result
