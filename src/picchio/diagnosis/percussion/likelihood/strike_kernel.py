"""Compiled: what poles answer to single blows, and the whitening of many series."""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import numpy as np
from numba import njit

from picchio.measurement.noise.whiten_kernel import whiten


@njit(cache=True, nogil=True)
def _within(lam, constant, slope, amplitude, omega, u):
    """The answer of z' = lam z + F from rest, u s into one piece of a blow."""
    e = np.exp(lam * u)
    out = 0.0j
    if abs(lam * u) < 1e-4:
        x = lam * u
        out += constant * u * (1.0 + x / 2.0 + x * x / 6.0)
        out += slope * u * u * (0.5 + x / 6.0 + x * x / 24.0)
    else:
        out += constant * (e - 1.0) / lam
        out += slope * (e - 1.0 - lam * u) / (lam * lam)
    if amplitude != 0.0:
        for c, mu in ((amplitude, 1j * omega), (np.conj(amplitude), -1j * omega)):
            d = lam - mu
            if abs(d * u) < 1e-6:
                out += 0.5 * c * np.exp(mu * u) * u
            else:
                out += 0.5 * c * (e - np.exp(mu * u)) / d
    return out


@njit(cache=True, nogil=True)
def answer(poles, pieces, amplitude, omega, end, begin, height, start, step, out, force):
    """Add the answer of each pole to one blow, and the blow's force, at the samples.

    Args:
        poles: (m,) 1/s.
        pieces: (p, 3) start, s, constant, N, and slope, N/s.
        amplitude: (p,) of a wave in each, N.
        omega: (p,) rad/s.
        end: s, of the last piece.
        begin: s, when the blow comes.
        height: by what it is multiplied.
        start: s, of the samples.
        step: s, between them.
        out: (m, count), added to.
        force: (count,), added to.
    """
    count, p = force.size, pieces.shape[0]
    first = max(int(np.ceil((max(begin, 0.0) - start) / step - 1e-9)), 0)
    for i in range(poles.size):
        lam = poles[i]
        at = np.zeros(p + 1, dtype=np.complex128)
        for j in range(p):
            to = pieces[j + 1, 0] if j + 1 < p else end
            span = to - pieces[j, 0]
            at[j + 1] = at[j] * np.exp(lam * span) + _within(
                lam, pieces[j, 1], pieces[j, 2], amplitude[j], omega[j], span
            )
        grown, z, tail = np.exp(lam * step), 0.0j, False
        for k in range(first, count):
            u = start + step * k - begin
            if u >= end:
                z = z * grown if tail else at[p] * np.exp(lam * (u - end))
                tail = True
            else:
                j = p - 1
                while j > 0 and pieces[j, 0] > u + 1e-12:
                    j -= 1
                v = max(u - pieces[j, 0], 0.0)
                z = at[j] * np.exp(lam * v) + _within(
                    lam, pieces[j, 1], pieces[j, 2], amplitude[j], omega[j], v
                )
            out[i, k] += height * z
    for k in range(first, count):
        u = start + step * k - begin
        if u >= end:
            break
        j = p - 1
        while j > 0 and pieces[j, 0] > u + 1e-12:
            j -= 1
        v = max(u - pieces[j, 0], 0.0)
        wave = (amplitude[j] * np.exp(1j * omega[j] * v)).real
        force[k] += height * (pieces[j, 1] + pieces[j, 2] * v + wave)


@njit(cache=True, nogil=True)
def whiten_all(series, predictors, deviation, out):
    """`whiten` row by row.

    Args:
        series: (k, m).
        predictors: as in `whiten`.
        deviation: as in `whiten`.
        out: (k, m), where it goes.
    """
    for i in range(series.shape[0]):
        whiten(series[i], predictors, deviation, out[i])
