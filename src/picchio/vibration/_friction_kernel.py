"""Dry friction within a step: a joint is held still where it can be, compiled."""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import numpy as np
from numba import njit

from picchio.vibration._exponential_kernel import taylor

COULOMB = 3
_FRICTION_SWEEPS = 4
_IDEAL = 2e-5  # rad/s, below which friction is taken as ideal


@njit(cache=True, nogil=True)
def _smooth_friction(free, gain, limit, smooth):
    """The f with f = limit tanh((free - gain f) / smooth), by bisection and Newton."""
    low, high = -limit, limit
    f = min(max(free / (gain + smooth / max(limit, 1e-300)), low), high)
    for _ in range(60):
        t = np.tanh((free - gain * f) / smooth)
        wrong = f - limit * t
        if wrong > 0.0:
            high = f
        else:
            low = f
        step = wrong / (1.0 + limit * (1.0 - t * t) * gain / smooth)
        new = f - step
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - f) <= 1e-9 * limit:
            return new
        f = new
    return f


@njit(cache=True, nogil=True)
def stick(
    new, n, rows, kinds, parameters, friction, kick, zero, length, regular,
    from_start, from_end, inverse, ik, ic, fastest,
):  # fmt: skip
    """Dry friction that holds a joint still at the step's end where it can, else its limit."""
    for e in range(kinds.size):
        if kinds[e] != COULOMB:
            continue
        if regular:
            for i in range(2 * n):
                total = 0.0
                for j in range(n):
                    total += (from_start[i, j] + from_end[i, j]) * rows[e, j]
                kick[e, i] = total
        else:
            taylor(zero, rows[e], rows[e], length, inverse, ik, ic, fastest, kick[e])
        friction[e] = 0.0
    for _ in range(_FRICTION_SWEEPS):
        for e in range(kinds.size):
            if kinds[e] != COULOMB:
                continue
            rate = 0.0
            gain = 0.0
            for j in range(n):
                rate += rows[e, j] * new[n + j]
                gain += rows[e, j] * kick[e, n + j]
            free = rate + gain * friction[e]  # the rate without this friction
            limit, smooth = parameters[e, 0], parameters[e, 1]
            if smooth <= _IDEAL:
                wanted = min(max(free / gain, -limit), limit)
            else:
                wanted = _smooth_friction(free, gain, limit, smooth)
            change = wanted - friction[e]
            friction[e] = wanted
            for i in range(2 * n):
                new[i] -= change * kick[e, i]
