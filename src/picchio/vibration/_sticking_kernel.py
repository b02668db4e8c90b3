"""Compiled time integration of systems in which something sticks: two looks a step.

As `picchio.vibration._integrate_kernel`, with dry friction, which may stop a joint anywhere within
a step (`picchio.vibration._friction_kernel`).
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import numpy as np
from numba import njit

from picchio.vibration._element_kernel import advance_state, element_force, kink_correction
from picchio.vibration._exponential_kernel import fastest_rate, step_matrices, taylor
from picchio.vibration._friction_kernel import COULOMB, stick

_BACKLASH, _CONTACT = 0, 4
# From so many time constants of the fastest mode on, matrices are cheaper than a series.
_STIFF = 30.0


@njit(cache=True, nogil=True)
def _pseudo_force(
    y, force, mass, gradient, curvature, inverse, damping, stiffness, b, b_gradient,
    kinds, parameters, rows, states, friction, square, line, out,
):  # fmt: skip
    """What the linear equations lack: M x'' = b F + p - C x' - K x. Into `out` (N,).

    y is (2N,); square (N, N) and line (3, N) are room to work in. Returns x'' (N,), within line.
    """
    n = b.size
    rest, linear, acceleration = line[0], line[1], line[2]
    for i in range(n):
        total = 0.0
        quadratic = 0.0
        curved = 0.0
        push = 0.0
        held = 0.0
        for j in range(n):
            tilt = 0.0
            rate = 0.0
            inner = 0.0
            bent = 0.0
            for k in range(n):
                tilt += gradient[k, i, j] * y[k]
                rate += gradient[k, i, j] * y[n + k]
                inner += gradient[i, j, k] * y[n + k]
                bent += curvature[k, i, j] * y[k]
            square[i, j] = tilt
            total += rate * y[n + j]
            quadratic += inner * y[n + j]
            curved += bent * y[j]
            push += b_gradient[i, j] * y[j]
            held += damping[i, j] * y[n + j] + stiffness[i, j] * y[j]
        rest[i] = push * force - total + 0.5 * quadratic - 0.5 * curved
        linear[i] = b[i] * force - held
    for e in range(kinds.size):
        d = 0.0
        dd = 0.0
        for j in range(n):
            d += rows[e, j] * y[j]
            dd += rows[e, j] * y[n + j]
        if kinds[e] == COULOMB:
            torque = -friction[e]
        else:
            torque = element_force(kinds[e], parameters[e], d, dd, states[e])
        for j in range(n):
            rest[j] += rows[e, j] * torque
    # x'' stands on both sides; two rounds leave (dM/M)^3.
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += inverse[i, j] * (linear[j] + rest[j])
        acceleration[i] = total
    for _ in range(2):
        for i in range(n):
            total = rest[i]
            for j in range(n):
                total -= square[i, j] * acceleration[j]
            out[i] = total
        for i in range(n):
            total = 0.0
            for j in range(n):
                total += inverse[i, j] * (linear[j] + out[j])
            acceleration[i] = total
    return acceleration


@njit(cache=True, nogil=True)
def integrate(
    start, mass, gradient, curvature, damping, stiffness, b, b_gradient,
    kinds, parameters, rows, start_states,
    step, lengths, regular, same, force0, force1, sample, force_after,
    x_out, v_out, a_out, end,
):  # fmt: skip
    """Advance from `start` over all steps and write the samples.

    As `picchio.vibration._integrate_kernel.integrate`; there are elements.
    """
    n = b.size
    inverse = np.linalg.inv(mass)
    ik, ic = inverse @ stiffness, inverse @ damping
    fastest = fastest_rate(ik, ic)
    exponential, from_start, from_end = step_matrices(inverse, damping, stiffness, step)
    elements = kinds.size
    y = start.copy()
    states = start_states.copy()
    friction, last = np.zeros(elements), np.zeros(elements)
    has_friction = False
    for e in range(elements):
        has_friction = has_friction or kinds[e] == COULOMB
    p0, p1, f0, f1 = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    guess, new = np.empty(2 * n), np.empty(2 * n)
    new_states = states.copy()
    kick = np.empty((elements, 2 * n))
    zero = np.zeros(2 * n)
    square, line, no_friction = np.empty((n, n)), np.empty((3, n)), np.zeros(elements)
    known, bend = False, np.empty(2)
    kept = 0
    for k in range(lengths.size):
        kept = max(kept, same[k] + 1)
    made = np.zeros(kept, dtype=np.bool_)
    short = np.empty((kept, 2 * n, 2 * n))
    short_start, short_end = np.empty((kept, 2 * n, n)), np.empty((kept, 2 * n, n))
    for k in range(lengths.size):
        if has_friction:
            for e in range(elements):
                friction[e] = 0.0
        # Where the last sample was read at this very state and force, it is known.
        if known and force0[k] == force_after[k - 1] and not has_friction:
            for i in range(n):
                p0[i] = p1[i]
        else:
            _pseudo_force(
                y, force0[k], mass, gradient, curvature, inverse, damping, stiffness,
                b, b_gradient, kinds, parameters, rows, states, friction, square, line, p0,
            )  # fmt: skip
        for i in range(n):
            f0[i] = b[i] * force0[k] + p0[i]
            f1[i] = b[i] * force1[k] + p0[i]
        whole, by_start, by_end = exponential, from_start, from_end
        by_matrix = regular[k]
        if not by_matrix and lengths[k] * fastest > _STIFF:
            u, by_matrix = same[k], True
            if not made[u]:
                made[u] = True
                one, two, three = step_matrices(inverse, damping, stiffness, lengths[k])
                short[u], short_start[u], short_end[u] = one, two, three
            whole, by_start, by_end = short[u], short_start[u], short_end[u]
        for attempt in range(2):
            if by_matrix:
                for i in range(2 * n):
                    total = 0.0
                    for j in range(2 * n):
                        total += whole[i, j] * y[j]
                    for j in range(n):
                        total += by_start[i, j] * f0[j] + by_end[i, j] * f1[j]
                    new[i] = total
            else:
                taylor(y, f0, f1, lengths[k], inverse, ik, ic, fastest, new)
            if has_friction:
                stick(y, last, new, n, rows, kinds, parameters, friction, kick, zero, lengths[k],
                       by_matrix, by_start, by_end, inverse, ik, ic, fastest)  # fmt: skip
            for e in range(elements):
                if kinds[e] == 2:
                    before = 0.0
                    after = 0.0
                    for j in range(n):
                        before += rows[e, j] * y[j]
                        after += rows[e, j] * new[j]
                    new_states[e] = advance_state(parameters[e], after - before, states[e])
            if attempt == 1:
                break
            for i in range(2 * n):
                guess[i] = new[i]
            # friction is in the step already, so the pseudo-force must not count it again
            _pseudo_force(
                guess, force1[k], mass, gradient, curvature, inverse, damping,
                stiffness, b, b_gradient, kinds, parameters, rows, new_states,
                no_friction, square, line, p1,
            )  # fmt: skip
            for i in range(n):
                f1[i] = b[i] * force1[k] + p1[i]
            for e in range(elements):
                if kinds[e] == _BACKLASH or kinds[e] == _CONTACT:
                    _add_kink(y, guess, lengths[k], rows[e], kinds[e], parameters[e], bend, f0, f1)
        for i in range(2 * n):
            y[i] = new[i]
        for e in range(elements):
            states[e] = new_states[e]
        known = sample[k] >= 0
        if known:
            s = sample[k]
            acceleration = _pseudo_force(
                y, force_after[k], mass, gradient, curvature, inverse, damping, stiffness,
                b, b_gradient, kinds, parameters, rows, states, last, square, line, p1,
            )  # fmt: skip
            for i in range(n):
                x_out[s, i] = y[i]
                v_out[s, i] = y[n + i]
                a_out[s, i] = acceleration[i]
    for i in range(2 * n):
        end[i] = y[i]
    for e in range(elements):
        end[2 * n + e] = states[e]


@njit(cache=True, nogil=True)
def _add_kink(start, end, length, row, kind, parameters, bend, f0, f1):
    """Put an element's kink within a step, from state start to end (2N,), into its line."""
    n = row.size
    d0, rate0, d1, rate1 = 0.0, 0.0, 0.0, 0.0
    for j in range(n):
        d0 += row[j] * start[j]
        rate0 += row[j] * start[n + j]
        d1 += row[j] * end[j]
        rate1 += row[j] * end[n + j]
    kink_correction(kind, parameters, d0, rate0, d1, rate1, length, bend)
    for j in range(n):
        f0[j] += row[j] * bend[0]
        f1[j] += row[j] * bend[1]
