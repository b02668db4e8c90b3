"""From the motion to what is read: the sensor's own dynamics, its axes, gain, filters and clock.

Signals come in intervals between the instants where a force jumps or a sensor reads: their values
just after the start, half-way, and just before the end, taken as a parabola in between.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numba import njit
from scipy.linalg import expm
from scipy.signal import butter, sosfilt

# e^-s (1 + s + s^2/2 + s^3/6), s = (f / f0)^2, is down by 3 dB at this f / f0.
_THREE_DB = 1.6607


@dataclass
class Sensor:
    """How one channel group reads, in the order in which it happens.

    Attributes:
        mount: (Hz, damping ratio) of the mount's resonance.
        turn: (3, 3), reading = turn @ motion.
        gain: factor.
        highpass, lowpass: Hz, first order; the high-pass of `order` 2 is Butterworth's. `digital`:
            by the bilinear transform, of what has been sampled.
        delay, rate: the sample stamped t is of t (1 + rate) - delay.
        limit: clipped to +- this, in the channel's unit.
        square: reading + square * reading^2, per channel's unit.
        fade: 1/s, the gain grows with the time since the first blow.
        hum: (amplitude, Hz).
        bandwidth: Hz, flat and without delay; None for endless.
        origin: true time of the stamp 0, s.
    """

    mount: tuple[float, float] | None = None
    turn: np.ndarray = field(default_factory=lambda: np.eye(3))
    gain: float = 1.0
    highpass: float | None = None
    order: int = 1
    digital: bool = False
    lowpass: float | None = None
    delay: float = 0.0
    rate: float = 0.0
    limit: float | None = None
    square: float = 0.0
    fade: float = 0.0
    hum: tuple[float, float] | None = None
    bandwidth: float | None = None
    origin: float = 0.0

    def instants(self, times):
        """The true times of samples stamped `times`."""
        return self.origin + times * (1.0 + self.rate) - self.delay

    def read(self, stops, signal, times, phase):
        """What is read, before noise.

        Args:
            stops: (m,) s.
            signal: (m - 1, 3, c) on the intervals.
            times: (k,) s, as stamped.
            phase: rad, of the hum.

        Returns:
            (k, c).
        """
        lengths = np.diff(stops)
        if self.mount is not None:
            w, ratio = 2.0 * np.pi * self.mount[0], self.mount[1]
            signal = _filtered(
                lengths, signal,
                np.array([[0.0, 1.0], [-w * w, -2.0 * ratio * w]]),
                np.array([0.0, 1.0]), np.array([w * w, 0.0]), 0.0,
            )  # fmt: skip
        if signal.shape[2] == 3 and not np.array_equal(self.turn, np.eye(3)):
            signal = signal @ self.turn.T
        signal = self.gain * signal
        if self.highpass is not None and self.digital:
            pass
        elif self.highpass is not None and self.order == 2:
            w = 2.0 * np.pi * self.highpass
            signal = _filtered(
                lengths, signal,
                np.array([[0.0, 1.0], [-w * w, -np.sqrt(2.0) * w]]),
                np.array([0.0, 1.0]), np.array([-w * w, -np.sqrt(2.0) * w]), 1.0,
            )  # fmt: skip
        elif self.highpass is not None:
            w = 2.0 * np.pi * self.highpass
            one = np.array([1.0])
            signal = _filtered(lengths, signal, np.array([[-w]]), one, np.array([-w]), 1.0)
        if self.lowpass is not None:
            w = 2.0 * np.pi * self.lowpass
            one = np.array([1.0])
            signal = _filtered(lengths, signal, np.array([[-w]]), one, np.array([w]), 0.0)
        instants = self.instants(times)
        signal = np.ascontiguousarray(signal)
        if self.bandwidth is None:
            out = _sampled(stops, signal, instants)
        else:
            nodes, weights = np.polynomial.legendre.leggauss(16)
            rate = np.pi * self.bandwidth / _THREE_DB
            out = _smoothed(stops, signal, instants, rate, nodes, weights)
        if self.highpass is not None and self.digital:
            rate = (times.size - 1) / (times[-1] - times[0])
            out = sosfilt(butter(self.order, self.highpass, "high", fs=rate, output="sos"), out, 0)
        if self.square:
            out = out + self.square * out**2
        if self.fade:
            out = out * (1.0 + self.fade * np.maximum(times, 0.0))[:, None]
        if self.limit is not None:
            out = np.clip(out, -self.limit, self.limit)
        if self.hum is not None:
            wave = self.hum[0] * np.sin(2.0 * np.pi * self.hum[1] * times + phase)
            out = out + wave[:, None]
        return out


def _filtered(lengths, signal, a, b, c, d):
    """x' = a x + b u, y = c x + d u, exactly for parabolas; from rest. Same shape as `signal`."""
    n = b.size
    keys, which = np.unique(np.round(lengths, 13), return_inverse=True)
    moves = np.zeros((keys.size, n, n + 3))
    for i, key in enumerate(keys):
        whole = np.zeros((n + 3, n + 3))
        whole[:n, :n] = a
        whole[:n, n] = b
        whole[n, n + 1] = 1.0
        whole[n + 1, n + 2] = 2.0
        moves[i] = expm(0.5 * key * whole)[:n]
    return _march(which.astype(np.int64), lengths, signal, moves, c, d)


@njit(cache=True)
def _march(which, lengths, signal, moves, c, d):
    n = c.size
    m, _, channels = signal.shape
    out = np.empty_like(signal)
    state = np.zeros((channels, n))
    full = np.empty(n + 3)
    for i in range(m):
        h = 0.5 * lengths[i]
        for k in range(channels):
            u0, u1, u2 = signal[i, 0, k], signal[i, 1, k], signal[i, 2, k]
            bend = (u0 - 2.0 * u1 + u2) / (2.0 * h * h)
            for part in range(3):
                value = d * signal[i, part, k]
                for j in range(n):
                    value += c[j] * state[k, j]
                out[i, part, k] = value
                if part == 2:
                    break
                full[:n] = state[k]
                if part == 0:
                    full[n], full[n + 1] = u0, (u1 - u0) / h - bend * h
                else:
                    full[n], full[n + 1] = u1, (u2 - u1) / h - bend * h
                full[n + 2] = bend
                for j in range(n):
                    total = 0.0
                    for q in range(n + 3):
                        total += moves[which[i], j, q] * full[q]
                    state[k, j] = total
    return out


@njit(cache=True)
def _sampled(stops, signal, instants):
    """Values just after each instant, which is a stop; zero before the first."""
    out = np.zeros((instants.size, signal.shape[2]))
    for k in range(instants.size):
        if instants[k] < stops[0] - 1e-10:
            continue
        i = np.searchsorted(stops, instants[k] + 1e-10) - 1
        if i < stops.size - 1:
            out[k] = signal[i, 0]
        else:
            out[k] = signal[i - 1, 2]
    return out


@njit(cache=True)
def _smoothed(stops, signal, instants, rate, nodes, weights):
    """As `_sampled`, through a symmetric kernel that is flat far into its band."""
    reach = 4.5 / rate
    channels = signal.shape[2]
    out = np.zeros((instants.size, channels))
    for k in range(instants.size):
        t = instants[k]
        low, high = t - reach, t + reach
        if high < stops[0]:
            continue
        total = 0.0
        i = max(np.searchsorted(stops, low) - 1, 0)
        if low < stops[0]:
            total += _share(low, stops[0], t, rate, nodes, weights)
        while i < stops.size - 1 and stops[i] < high:
            a, b = max(stops[i], low), min(stops[i + 1], high)
            half, h = 0.5 * (b - a), 0.5 * (stops[i + 1] - stops[i])
            for g in range(nodes.size):
                s = a + half * (1.0 + nodes[g])
                w = weights[g] * half * _bell(rate * (s - t)) * rate
                total += w
                p = (s - stops[i]) / h - 1.0
                left, centre, right = 0.5 * p * (p - 1.0), 1.0 - p * p, 0.5 * p * (p + 1.0)
                for c in range(channels):
                    out[k, c] += w * (
                        left * signal[i, 0, c] + centre * signal[i, 1, c] + right * signal[i, 2, c]
                    )
            i += 1
        out[k] /= total
    return out


@njit(cache=True)
def _share(a, b, t, rate, nodes, weights):
    half, total = 0.5 * (b - a), 0.0
    for g in range(nodes.size):
        total += weights[g] * half * _bell(rate * (a + half * (1.0 + nodes[g]) - t)) * rate
    return total


@njit(cache=True)
def _bell(y):
    """Inverse transform of e^-s (1 + s + s^2/2 + s^3/6), scaled to area one."""
    u = y * y
    h2 = 4.0 * u - 2.0
    h4 = (16.0 * u - 48.0) * u + 12.0
    h6 = ((64.0 * u - 480.0) * u + 720.0) * u - 120.0
    return np.exp(-u) / np.sqrt(np.pi) * (1.0 - h2 / 4.0 + h4 / 32.0 - h6 / 384.0)
