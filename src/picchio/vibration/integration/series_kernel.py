"""Compiled: what one mode answers to the force, and how that changes with its pole."""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import numpy as np
from numba import njit

_TERMS = 14
_SMALL = 1.0  # below which the series is taken, where the closed form cancels


@njit(cache=True, nogil=True)
def _weights(u):
    """phi_1, phi_2 and their derivatives at u, phi_k = sum of u^m / (m + k)!."""
    if abs(u) > _SMALL:
        e = np.exp(u)
        one, two = (e - 1.0) / u, (e - 1.0 - u) / u**2
        return one, two, (u * e - e + 1.0) / u**2, (u * e - 2.0 * e + u + 2.0) / u**3
    one = two = one_slope = two_slope = 0.0j
    power, before, factorial = 1.0 + 0.0j, 0.0j, 1.0
    for m in range(_TERMS):
        factorial /= m + 1.0  # 1 / (m + 1)!
        one += power * factorial
        two += power * factorial / (m + 2.0)
        one_slope += m * before * factorial
        two_slope += m * before * factorial / (m + 2.0)
        before = power
        power *= u
    return one, two, one_slope, two_slope


@njit(cache=True, nogil=True)
def modal_series(poles, lengths, force0, force1, sample, force_after, y_out, slope_out, force_out):
    """What modes answer to the force, y' = pole y + F from rest, and dy/dpole, at the samples.

    Args:
        poles: (m,) 1/s.
        lengths: (K,) s, of the steps.
        force0: (K,) N, at the start of each; it is straight over a step.
        force1: (K,) N, at the end of each.
        sample: (K + 1,) the sample at each point between steps, or -1, as in `Plan`.
        force_after: (K + 1,) N, just after each point.
        y_out: (samples, m) is written.
        slope_out: (samples, m) is written.
        force_out: (samples,) is written.
    """
    count = poles.size
    y, slope = np.zeros(count, dtype=np.complex128), np.zeros(count, dtype=np.complex128)
    grown, start, end = np.empty_like(y), np.empty_like(y), np.empty_like(y)
    start_slope, end_slope = np.empty_like(y), np.empty_like(y)
    if sample[0] >= 0:
        force_out[sample[0]] = force_after[0]
    last = -1.0
    for k in range(lengths.size):
        h = lengths[k]
        if h != last:
            last = h
            for i in range(count):
                one, two, one_slope, two_slope = _weights(poles[i] * h)
                grown[i] = np.exp(poles[i] * h)
                start[i], end[i] = h * (one - two), h * two
                start_slope[i], end_slope[i] = h * h * (one_slope - two_slope), h * h * two_slope
        for i in range(count):
            slope[i] = grown[i] * (slope[i] + h * y[i])
            slope[i] += start_slope[i] * force0[k] + end_slope[i] * force1[k]
            y[i] = grown[i] * y[i] + start[i] * force0[k] + end[i] * force1[k]
        s = sample[k + 1]
        if s >= 0:
            force_out[s] = force_after[k + 1]
            for i in range(count):
                y_out[s, i], slope_out[s, i] = y[i], slope[i]
