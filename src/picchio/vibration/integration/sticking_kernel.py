"""Compiled time integration with dry friction: two evaluations a step.

As `integrate_kernel`, with dry friction, which may stop a joint anywhere within a step
(`friction_kernel`).
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import numpy as np
from numba import njit

from picchio.vibration.integration.friction_kernel import COULOMB, stick
from picchio.vibration.integration.integrate_kernel import add_kink, advance, lacking, packed
from picchio.vibration.integration.step_kernel import fastest_rate, step_matrices, taylor

_BACKLASH, _CONTACT = 0, 4
# From so many time constants of the fastest mode on, matrices are cheaper than a series.
_STIFF = 30.0


@njit(cache=True, nogil=True)
def integrate(
    start, mass, gradient, curvature, damping, stiffness, b, b_gradient,
    kinds, parameters, rows, start_states,
    step, lengths, regular, same, force0, force1, sample, force_after,
    x_out, v_out, a_out, end,
):  # fmt: skip
    """Advance from `start` over all steps and write the samples.

    As `integrate_kernel.integrate`; there is friction among the elements.
    """
    n = b.size
    inverse = np.linalg.inv(mass)
    ik, ic = inverse @ stiffness, inverse @ damping
    fastest = fastest_rate(ik, ic)
    exponential, from_start, from_end = step_matrices(inverse, damping, stiffness, step)
    regular_start, regular_end = from_start @ mass, from_end @ mass
    quadratic, tilts = packed(inverse, gradient, curvature)
    own, push, pulls = inverse @ b, inverse @ b_gradient, rows @ inverse
    held = np.empty((n, 2 * n))
    held[:, :n] = ik
    held[:, n:] = ic
    eye = np.eye(n)
    elements = kinds.size
    y = start.copy()
    states = start_states.copy()
    friction, last = np.zeros(elements), np.zeros(elements)
    p0, p1, f0, f1 = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    guess, new = np.empty(2 * n), np.empty(2 * n)
    new_states = states.copy()
    kick = np.empty((elements, 2 * n))
    zero = np.zeros(2 * n)
    products, square, rest, a = np.empty(n * (n + 1)), np.empty((n, n)), np.empty(n), np.empty(n)
    given, bend = np.zeros(elements), np.empty(2)
    kept = 0
    for k in range(lengths.size):
        kept = max(kept, same[k] + 1)
    made = np.zeros(kept, dtype=np.bool_)
    short = np.empty((kept, 2 * n, 2 * n))
    short_start, short_end = np.empty((kept, 2 * n, n)), np.empty((kept, 2 * n, n))
    for k in range(lengths.size):
        # Friction is in the step itself, as `stick` finds it: the pseudo-force must not count it.
        for e in range(elements):
            friction[e] = 0.0
            given[e] = 0.0
        lacking(
            y, force0[k], own, push, held, quadratic, tilts, kinds, parameters, rows, pulls,
            states, given, products, square, rest, p0, a,
        )  # fmt: skip
        for i in range(n):
            f0[i] = own[i] * force0[k] + p0[i]
            f1[i] = own[i] * force1[k] + p0[i]
        whole, by_start, by_end = exponential, from_start, from_end
        at_start, at_end = regular_start, regular_end
        by_matrix = regular[k]
        if not by_matrix and lengths[k] * fastest > _STIFF:
            u, by_matrix = same[k], True
            if not made[u]:
                made[u] = True
                one, two, three = step_matrices(inverse, damping, stiffness, lengths[k])
                short[u], short_start[u], short_end[u] = one, two, three
            whole, by_start, by_end = short[u], short_start[u], short_end[u]
            at_start, at_end = by_start @ mass, by_end @ mass
        for attempt in range(2):
            if by_matrix:
                for i in range(2 * n):
                    total = 0.0
                    for j in range(2 * n):
                        total += whole[i, j] * y[j]
                    for j in range(n):
                        total += at_start[i, j] * f0[j] + at_end[i, j] * f1[j]
                    new[i] = total
            else:
                taylor(y, f0, f1, lengths[k], eye, ik, ic, fastest, new)
            stick(y, last, new, n, rows, kinds, parameters, friction, kick, zero, lengths[k],
                  by_matrix, by_start, by_end, inverse, ik, ic, fastest)  # fmt: skip
            advance(kinds, parameters, rows, y, new, states, new_states)
            if attempt == 1:
                break
            for i in range(2 * n):
                guess[i] = new[i]
            lacking(
                guess, force1[k], own, push, held, quadratic, tilts, kinds, parameters, rows, pulls,
                new_states, given, products, square, rest, p1, a,
            )  # fmt: skip
            for i in range(n):
                f1[i] = own[i] * force1[k] + p1[i]
            for e in range(elements):
                if kinds[e] == _BACKLASH or kinds[e] == _CONTACT:
                    add_kink(
                        y, guess, lengths[k], rows[e], pulls[e], kinds[e], parameters[e], bend, f0,
                        f1,
                    )  # fmt: skip
        for i in range(2 * n):
            y[i] = new[i]
        for e in range(elements):
            states[e] = new_states[e]
        if sample[k] >= 0:
            s = sample[k]
            for e in range(elements):
                given[e] = -last[e] if kinds[e] == COULOMB else 0.0
            lacking(
                y, force_after[k], own, push, held, quadratic, tilts, kinds, parameters, rows,
                pulls, states, given, products, square, rest, p1, a,
            )  # fmt: skip
            for i in range(n):
                x_out[s, i] = y[i]
                v_out[s, i] = y[n + i]
                a_out[s, i] = a[i]
    for i in range(2 * n):
        end[i] = y[i]
    for e in range(elements):
        end[2 * n + e] = states[e]
