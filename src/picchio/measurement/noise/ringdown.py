"""Noise from a ring-down: what fitted damped sines leave; no model of the robot is needed.

After the last blow any linear structure, seen through any linear sensors, rings down as a sum of
damped waves whose poles all channels share. The poles come from the signal subspace of the Hankel
matrices of all channels (HSVD: H. Barkhuijsen et al., J. Magn. Reson. 73, 1987), and are then
refined by least squares with the amplitudes eliminated (variable projection, Gauss-Newton).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import ComplexArray, FloatArray
from picchio.measurement.noise.autoregression import fit_autoregression

_MOST_POLES = 24
_LONGEST = 1500
_MOST_SAMPLES = 6000
_STEPS = 3
_COLOUR = 6
MAINS = (50.0, 60.0)  # Hz


@dataclass(frozen=True, eq=False)
class RingDown:
    """Damped waves fitted to all channels of a ring-down.

    Attributes:
        residual: (c, m) what they leave.
        parameters: numbers fitted per channel, the shared poles' share included.
        poles: (k,) rad/s, one of each pair.
    """

    residual: FloatArray
    parameters: float
    poles: ComplexArray


def fit_ring_down(series: FloatArray, rate: float) -> RingDown | None:
    """Damped waves, a constant and the mains, fitted to the channels of a ring-down.

    Args:
        series: (c, m) the channels after the last blow; at most 6000 samples are used.
        rate: samples a second, Hz.

    Returns:
        None where it is too short to tell waves from noise.
    """
    x = np.asarray(series, dtype=np.float64)[:, :_MOST_SAMPLES]
    m = x.shape[1]
    scale = np.sqrt(np.mean(np.diff(x, n=2, axis=1) ** 2, axis=1) / 6.0) if m > 3 else np.zeros(1)
    alive = scale > 0.0
    if m < 200 or not alive.any():
        return None
    y = x[alive] / scale[alive][:, None]
    time = np.arange(m) / rate
    best: tuple[float, ComplexArray, FloatArray, FloatArray] | None = None
    for poles in _trials(y, rate):
        refined = _refine(poles, y, time)
        q, _ = np.linalg.qr(_basis(refined, time))
        left = y - (y @ q) @ q.T
        # By what remains unpredictable: slow noise must not be taken for more waves.
        power = [fit_autoregression([one], _COLOUR).variances[-1] for one in left]
        count = q.shape[1] + 2.0 * refined.size / len(y)
        criterion = m * np.log(power).sum() + len(y) * count * np.log(m)
        if best is None or criterion < best[0]:
            best = (criterion, refined, left, np.array(count))
        elif refined.size > best[1].size + 4:
            break
    if best is None or float(best[3]) > m / 4:
        return None
    residual = np.zeros_like(x)
    residual[alive] = best[2] * scale[alive][:, None]
    return RingDown(residual, float(best[3]), best[1])


def _trials(y: FloatArray, rate: float) -> list[ComplexArray]:
    """Sets of poles of growing size, from none."""
    from scipy.linalg import eigh

    m = y.shape[1]
    thin = max(1, -(-m // _LONGEST))
    short = y[:, : m // thin * thin].reshape(len(y), -1, thin).mean(axis=2)
    short = short - short.mean(axis=1, keepdims=True)
    rows = short.shape[1] // 3
    if rows < 30:
        return [np.zeros(0, complex)]
    covariance = np.zeros((rows, rows))
    for channel in short:
        hankel = np.lib.stride_tricks.sliding_window_view(channel, rows)
        covariance += hankel.T @ hankel
    _, vectors = eigh(covariance, subset_by_index=[rows - _MOST_POLES, rows - 1])
    subspace = vectors[:, ::-1]
    found = [np.zeros(0, complex)]
    for size in range(2, _MOST_POLES + 1, 2):
        part = subspace[:, :size]
        step, *_ = np.linalg.lstsq(part[:-1], part[1:], rcond=None)
        z = np.linalg.eigvals(step)
        s = np.log(np.where(np.abs(z) > 1e-6, z, 1e-6)) * rate / thin
        # Waves that grow are noise; those that die within a few samples cannot be told from it.
        keep = (s.imag > 0.0) & (s.real < 0.5 * rate / m) & (s.real > -0.2 * rate / thin)
        found.append(s[keep])
    return found


def _basis(poles: ComplexArray, time: FloatArray) -> FloatArray:
    """(m, 2 k + 5) the waves, a constant and the mains."""
    waves = np.exp(np.outer(time, poles))
    mains = [f(2.0 * np.pi * hz * time) for hz in MAINS for f in (np.cos, np.sin)]
    return np.column_stack([np.ones(time.size), *mains, waves.real, waves.imag])


def _refine(poles: ComplexArray, y: FloatArray, time: FloatArray) -> ComplexArray:
    """Gauss-Newton steps on the poles, the amplitudes eliminated; kept while they help."""
    if not poles.size:
        return poles
    best, cost = poles, np.inf
    current = poles
    for _ in range(_STEPS + 1):
        basis = _basis(current, time)
        q, r = np.linalg.qr(basis)
        left = y - (y @ q) @ q.T
        weight = 1.0 / np.sqrt((left**2).mean(axis=1))
        now = float(np.log((left**2).sum(axis=1)).sum())
        if now > cost - 1e-4:
            break
        best, cost = current, now
        if np.abs(np.diag(r)).min() < 1e-9 * np.abs(np.diag(r)).max():
            break
        fit = np.linalg.solve(r, q.T @ y.T)
        k = current.size
        a, b = fit[5 : 5 + k], fit[5 + k : 5 + 2 * k]
        ramp = time[:, None] * np.exp(np.outer(time, current))
        rows, goals = [], []
        for c in range(len(y)):
            wave = ramp * (a[:, c] - 1j * b[:, c])  # d/ds of a Re + b Im of exp(s t)
            slope = np.hstack([wave.real, -wave.imag])
            slope = (slope - q @ (q.T @ slope)) * weight[c]
            rows.append(slope.T @ slope)
            goals.append(slope.T @ (left[c] * weight[c]))
        normal = np.sum(rows, axis=0)
        normal += 1e-9 * np.diag(np.diag(normal) + 1e-300)
        change = np.linalg.lstsq(normal, np.sum(goals, axis=0), rcond=None)[0]
        limit = 0.3 * np.maximum(np.abs(current.real), 2.0 / time[-1])
        delta = change[:k] + 1j * change[k:]
        current = current + delta * np.minimum(1.0, limit / np.maximum(np.abs(delta), 1e-300))
    return best
