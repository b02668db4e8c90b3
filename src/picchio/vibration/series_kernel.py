"""Compiled search for the top of a joint's response near a sample, by a series in time."""

from __future__ import annotations

from numba import njit

from picchio.core.arrays import ComplexArray, FloatArray

# Derivatives of g that are taken, and how far from the sample, in rad of the fastest mode, they
# serve: 0.35^12 / 12! = 7e-15 of that mode's share is left out.
TERMS = 12
_NEAR = 0.35
_NEWTON = 6


@njit(cache=True, error_model="numpy", inline="always")
def series_top(
    joint: int,
    k: int,
    hint: float,
    low: float,
    high: float,
    force: float,
    tilt: float,
    poles: ComplexArray,
    eta: FloatArray,
    rate: FloatArray,
    shapes: FloatArray,
    push: FloatArray,
    terms: FloatArray,
    g: FloatArray,
) -> float:
    """|g|^2 at its top near a sample, and g (3,) there; negative where the top is not near.

    The sample has every mode's state already, so that no exponential is taken.

    Args:
        joint: whose response.
        k: the sample.
        hint: s, from the sample to where the top is thought to be.
        low: s, how far back the sample's piece of the force goes.
        high: s, how far ahead.
        force: N, at the sample.
        tilt: N/s, its slope.
        poles: (n,) ascending, 1/s.
        eta: (n, samples) deflections of the modes.
        rate: (n, samples) real parts of their states.
        shapes: (joints, n).
        push: (n, 3).
        terms: (TERMS, 3) scratch: derivatives of g, then its series.
        g: (3,) out.
    """
    n = poles.shape[0]
    most = _NEAR / poles[n - 1].imag
    for m in range(TERMS):
        terms[m, 0], terms[m, 1], terms[m, 2] = 0.0, 0.0, 0.0
    for i in range(n):
        fall, spin = poles[i].real, poles[i].imag
        twice, square = 2.0 * fall, fall * fall + spin * spin
        q0 = shapes[joint, i] * push[i, 0]
        q1 = shapes[joint, i] * push[i, 1]
        q2 = shapes[joint, i] * push[i, 2]
        before = eta[i, k]
        here = rate[i, k] + fall * before
        drive, next_drive = force, tilt
        for m in range(TERMS):
            terms[m, 0] += q0 * before
            terms[m, 1] += q1 * before
            terms[m, 2] += q2 * before
            before, here = here, drive + twice * here - square * before
            drive, next_drive = next_drive, 0.0
    factor = 1.0
    for m in range(2, TERMS):
        factor /= m
        for d in range(3):
            terms[m, d] *= factor
    s = min(max(hint, low), high)
    for _ in range(_NEWTON):
        # The axes side by side: each chain of products waits for itself alone.
        y0, y1, y2 = terms[TERMS - 1, 0], terms[TERMS - 1, 1], terms[TERMS - 1, 2]
        w0, w1, w2, z0, z1, z2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for m in range(TERMS - 2, -1, -1):
            z0, z1, z2 = z0 * s + w0, z1 * s + w1, z2 * s + w2
            w0, w1, w2 = w0 * s + y0, w1 * s + y1, w2 * s + y2
            y0, y1, y2 = y0 * s + terms[m, 0], y1 * s + terms[m, 1], y2 * s + terms[m, 2]
        norm = y0 * y0 + y1 * y1 + y2 * y2
        first = y0 * w0 + y1 * w1 + y2 * w2
        second = w0 * w0 + w1 * w1 + w2 * w2 + 2.0 * (y0 * z0 + y1 * z1 + y2 * z2)
        if not second < 0.0:
            return -1.0
        step = -first / second
        if not (low <= s + step <= high and abs(s + step) <= most):
            return -1.0
        if abs(step) <= 1e-4 * most:  # 3e-5 rad: what is left is its cube
            g[0] = y0 + step * (w0 + step * z0)
            g[1] = y1 + step * (w1 + step * z1)
            g[2] = y2 + step * (w2 + step * z2)
            return norm - first * first / second
        s += step
    return -1.0
