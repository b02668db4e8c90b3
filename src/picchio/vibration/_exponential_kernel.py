"""One step of a linear system under a force that is a straight line: exact, compiled."""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import numpy as np
from numba import njit

_TAYLOR = 14
_MOST_PARTS = 4000


@njit(cache=True, nogil=True)
def step_matrices(inverse, damping, stiffness, step):
    """exp(A h) (2N, 2N) and what a pseudo-force at start and end of a step adds, (2N, N) each."""
    n = inverse.shape[0]
    size = 4 * n
    a = np.zeros((size, size))
    ik, ic = inverse @ stiffness, inverse @ damping
    for i in range(n):
        a[i, n + i] = step
        a[2 * n + i, 3 * n + i] = 1.0
        for j in range(n):
            a[n + i, j] = -step * ik[i, j]
            a[n + i, n + j] = -step * ic[i, j]
            a[n + i, 2 * n + j] = step * inverse[i, j]
    # Scaled as states are: the velocity's unit would make the norm large.
    norm = 0.0
    for i in range(n):
        norm = max(norm, np.sqrt(step * step * np.abs(ik[i]).sum()) + step * np.abs(ic[i]).sum())
    halvings = 0
    while norm > 0.5:
        norm *= 0.5
        halvings += 1
    a /= 2.0**halvings
    total = np.eye(size)
    term = np.eye(size)
    for k in range(1, 18):
        term = term @ a / k
        total += term
    for _ in range(halvings):
        total = total @ total
    exponential = total[: 2 * n, : 2 * n].copy()
    constant = total[: 2 * n, 2 * n : 3 * n].copy()
    slope = total[: 2 * n, 3 * n :].copy()
    return exponential, constant - slope, slope


@njit(cache=True, nogil=True)
def fastest_rate(ik, ic):
    """A bound of the system's rates, 1/s."""
    most = 0.0
    for i in range(ik.shape[0]):
        most = max(most, np.sqrt(np.abs(ik[i]).sum()) + np.abs(ic[i]).sum())
    return most


@njit(cache=True, nogil=True)
def taylor(y, f0, f1, length, inverse, ik, ic, fastest, out):
    """exp(A s) y plus the force that goes from f0 to f1 in a straight line over `length`."""
    n = f0.size
    parts = min(max(int(np.ceil(length * fastest)), 1), _MOST_PARTS)
    short = length / parts
    slope = (f1 - f0) / parts
    term = np.empty(2 * n)
    new = np.empty(2 * n)
    for i in range(2 * n):
        out[i] = y[i]
    for part in range(parts):
        for i in range(2 * n):
            term[i] = out[i]  # the k-th derivative times length^k / k!
        for k in range(1, _TAYLOR):
            for i in range(n):
                new[i] = term[n + i]
                total = 0.0
                for j in range(n):
                    total -= ik[i, j] * term[j] + ic[i, j] * term[n + j]
                    # The force is there in the first derivative; its slope comes in the second.
                    if k == 1:
                        total += inverse[i, j] * (f0[j] + part * slope[j])
                    elif k == 2:
                        total += inverse[i, j] * slope[j]
                new[n + i] = total
            for i in range(2 * n):
                term[i] = new[i] * short / k
                out[i] += term[i]
