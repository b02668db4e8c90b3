"""The noise of every channel from the quiet time before the blows, colour included.

The arm answers at low frequency, where short quiet pieces say least: a general autoregression
of low order is off by a quarter there. Sensors' noise is white plus something slow, so white
noise plus a first-order autoregression is fitted, its shape pooled over a channel group, by
the exact likelihood of the pieces.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.measurement.noise.autoregression import AutoRegression
from picchio.measurement.noise.hum import Line
from picchio.measurement.noise.level import Noise
from picchio.measurement.noise.ringdown import MAINS
from picchio.prediction.percussion import PercussionSetup

# Fewer quiet samples a channel than this say too little.
LEAST_SAMPLES = 120
_ORDER = 24
_LONGEST = 400
_SMALL = 2e-3
_JITTER = 1e-12
# A line in the quiet time is one where chance would make it once in a million channels.
_LINE = 30.0


def quiet_noise(
    setups: Sequence[PercussionSetup], values: Sequence[Mapping[str, FloatArray]]
) -> dict[str, Noise]:
    """Noise of the channels that have quiet time enough; others are left out.

    Args:
        setups: of the records.
        values: channel -> (m,) of each record, SI.
    """
    groups: dict[str, dict[str, list[FloatArray]]] = {}
    units: dict[str, tuple[str, float, bool]] = {}
    for setup, data in zip(setups, values, strict=True):
        count = int(np.searchsorted(setup.samples.times, -0.5 * setup.samples.step))
        if setup.steady or count < 16:
            continue
        for channel in setup.channels:
            if channel.name in data:
                pieces = groups.setdefault(channel.group, {}).setdefault(channel.name, [])
                pieces.append(data[channel.name][:count][-_LONGEST:])
                units[channel.name] = (channel.unit, setup.samples.step, channel.kind.free_offset)
    found: dict[str, Noise] = {}
    for channels in groups.values():
        if min(sum(p.size for p in pieces) for pieces in channels.values()) >= LEAST_SAMPLES:
            found |= _group(channels, units)
    return found


def _group(
    channels: Mapping[str, list[FloatArray]], units: Mapping[str, tuple[str, float, bool]]
) -> dict[str, Noise]:
    from scipy.optimize import minimize

    some = next(iter(channels))
    _, step, centred = units[some]
    hum = _hum(channels, step)
    basis_of = {
        n: _basis(n, step, hum, centred) for n in {p.size for c in channels.values() for p in c}
    }
    rough = {
        name: float(np.sqrt(np.mean(np.concatenate([p - p.mean() for p in pieces]) ** 2))) or 1.0
        for name, pieces in channels.items()
    }
    scaled = [p / rough[name] for name, pieces in channels.items() for p in pieces]
    stacks = {n: np.stack([p for p in scaled if p.size == n], axis=1) for n in basis_of}

    def cost(u: FloatArray) -> float:
        share, slow = 1.0 / (1.0 + np.exp(-u[0])), np.tanh(u[1])
        total, squares, count = 0.0, 0.0, 0
        for n, stack in stacks.items():
            log_det, square, free = _likelihood(stack, basis_of[n], share, slow)
            total += stack.shape[1] * log_det
            squares += square
            count += free * stack.shape[1]
        return float(total + count * np.log(squares / count))

    white = cost(np.array([-12.0, 0.0]))
    tried = [
        minimize(cost, start, method="Nelder-Mead", options={"xatol": 0.02, "fatol": 0.05})
        for start in (np.array([-1.5, 0.9]), np.array([1.0, 0.2]))
    ]
    best = min(tried, key=lambda r: r.fun)
    # Two more numbers must pay for themselves.
    coloured = best.fun < white - 6.0
    u = best.x if coloured else np.array([-12.0, 0.0])
    share, slow = 1.0 / (1.0 + np.exp(-u[0])), float(np.tanh(u[1]))
    reflection = _reflection(share, slow) if coloured else np.zeros(0)
    found = {}
    for name, pieces in channels.items():
        squares, count = 0.0, 0
        for p in pieces:
            _, square, free = _likelihood(p[:, None], basis_of[p.size], share, slow)
            squares, count = squares + square, count + free
        variance = squares / count
        if variance <= 0.0:
            continue
        found[name] = Noise(
            channel=name,
            unit=units[name][0],
            rate=1.0 / step,
            std=float(np.sqrt(variance)),
            error=1.0 / float(np.sqrt(2.0 * count)),
            model=AutoRegression(reflection, variance),
            hum=tuple(hum.get(name, ())),
        )
    return found


def _likelihood(
    stack: FloatArray, basis: FloatArray, share: float, slow: float
) -> tuple[float, float, int]:
    """(log determinant, generalised sum of squares, free samples) of pieces in columns."""
    from scipy.linalg import cholesky_banded, solve_banded

    # A sample less its share of the one before is correlated with its neighbours alone, and the
    # determinant stays (Box, Jenkins, Reinsel, Time Series Analysis, 4th ed. (2008), section 5.5).
    n, rest = len(stack), 1.0 - share + _JITTER
    bands = np.empty((2, n))
    bands[0] = share * (1.0 - slow**2) + rest * (1.0 + slow**2)
    bands[0, 0], bands[1] = share + rest, -rest * slow
    lower = cholesky_banded(bands, lower=True)

    def whitened(rows: FloatArray) -> FloatArray:
        apart = rows.copy()
        apart[1:] -= slow * rows[:-1]
        return np.asarray(solve_banded((1, 0), lower, apart))

    white = whitened(stack)
    log_det = 2.0 * float(np.log(lower[0]).sum())
    if basis.shape[1]:
        q, r = np.linalg.qr(whitened(basis))
        white = white - q @ (q.T @ white)
        log_det += 2.0 * float(np.log(np.abs(r.diagonal())).sum())
    return log_det, float((white**2).sum()), n - basis.shape[1]


def _basis(n: int, step: float, hum: Mapping[str, Sequence[Line]], centred: bool) -> FloatArray:
    columns = [np.ones(n)] if centred else []
    for frequency in sorted({line.frequency for lines in hum.values() for line in lines}):
        phase = 2.0 * np.pi * frequency * step * np.arange(n)
        columns += [np.cos(phase), np.sin(phase)]
    return np.stack(columns, axis=1) if columns else np.zeros((n, 0))


def _hum(channels: Mapping[str, list[FloatArray]], step: float) -> dict[str, list[Line]]:
    """Lines of the mains, by the power at their frequency against that beside it."""
    found: dict[str, list[Line]] = {}
    for name, pieces in channels.items():
        for frequency in MAINS:
            if frequency > 0.4 / step:
                continue
            here, beside = [], []
            for p in pieces:
                width = 4.0 / (p.size * step)
                here.append(_power(p, step, frequency))
                beside.append(_power(p, step, frequency + width))
                beside.append(_power(p, step, max(frequency - width, width)))
            ratio = (
                len(pieces) * float(np.mean(here)) / max(float(np.median(beside)) / 0.69, 1e-300)
            )
            if ratio > _LINE + 2.0 * len(pieces):
                gain = float(np.mean([np.hanning(p.size).sum() for p in pieces]))
                amplitude = 2.0 * float(np.sqrt(np.mean(here))) / gain
                found.setdefault(name, []).append(Line(frequency, amplitude))
    return found


def _power(piece: FloatArray, step: float, frequency: float) -> float:
    time = step * np.arange(piece.size)
    line = np.exp(-2j * np.pi * frequency * time)
    return float(np.abs((np.hanning(piece.size) * piece) @ line) ** 2)


def _reflection(share: float, slow: float) -> FloatArray:
    """Partial correlations of white noise plus a first-order autoregression (Levinson)."""
    covariance = np.append(1.0, share * slow ** np.arange(1, _ORDER + 1))
    a, left, found = np.zeros(0), 1.0, []
    for k in range(1, _ORDER + 1):
        r = (covariance[k] - a @ covariance[k - 1 : 0 : -1]) / left if k > 1 else covariance[1]
        found.append(r)
        a = np.append(a - r * a[::-1], r)
        left *= 1.0 - r * r
        if abs(r) < _SMALL:
            break
    return np.array(found)
