"""Compiled time integration: the linear part exact, everything else as a pseudo-force.

y = (x, x') obeys y' = A y + B (b F(t) + p(t, y)). The linear part is advanced by the matrix
exponential; bF and p are taken as straight lines over a step (exponential predictor-corrector,
Hochbruck and Ostermann, Acta Numerica 19 (2010) 209, doi:10.1017/S0962492910000048). Steps that
a force edge cuts short are advanced by the Taylor series of the same exponential.

Over a step p is first extrapolated from the last one, evaluated where that leads, and the step
corrected. At a jump of the force, and where something touches or lets go, it is evaluated twice.
With dry friction, which may stop a joint anywhere within a step (`friction_kernel`), nothing is
extrapolated: each step is evaluated twice.
All is in units of acceleration, M^-1 times the forces.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import numpy as np
from numba import njit

from picchio.vibration.integration.element_kernel import (
    advance_state,
    element_force,
    kink_correction,
)
from picchio.vibration.integration.friction_kernel import COULOMB, stick
from picchio.vibration.integration.step_kernel import fastest_rate, step_matrices, taylor

# From so many time constants of the fastest mode on, matrices are cheaper than a series.
_STIFF = 30.0
_BOUC_WEN = 2


@njit(cache=True, nogil=True)
def packed(inverse, gradient, curvature):
    """What is summed over pairs of coordinates, a pair once.

    Returns:
        quadratic (N, N (N + 1)), on the products of rates, then of deflections: inertia's forces
        and gravity's curvature; tilts (N, N, N), [i, j, k] on deflection k: the mass's change.
    """
    n = gradient.shape[0]
    pairs = n * (n + 1) // 2
    forces, tilts = np.empty((n, 2 * pairs)), np.zeros((n, n, n))
    for i in range(n):
        p = 0
        for j in range(n):
            for k in range(j + 1):
                rates = gradient[j, i, k] - 0.5 * gradient[i, j, k]
                bent = 0.5 * curvature[j, i, k]
                if j != k:
                    rates += gradient[k, i, j] - 0.5 * gradient[i, k, j]
                    bent += 0.5 * curvature[k, i, j]
                forces[i, p] = rates
                forces[i, pairs + p] = bent
                p += 1
    for i in range(n):
        for j in range(n):
            for k in range(n):
                for m in range(n):
                    tilts[i, j, k] += inverse[i, m] * gradient[k, m, j]
    return inverse @ forces, tilts


@njit(cache=True, nogil=True)
def _prepared(
    mass, gradient, curvature, damping, stiffness, b, b_gradient, rows, step, lengths, regular, same
):
    """What `integrate` needs of the equations, M^-1 on all, of its steps, and room to work in."""
    n = b.size
    inverse = np.linalg.inv(mass)
    held = np.empty((n, 2 * n))
    held[:, :n] = inverse @ stiffness
    held[:, n:] = inverse @ damping
    ik, ic = held[:, :n].copy(), held[:, n:].copy()
    quadratic, tilts = packed(inverse, gradient, curvature)
    pushed = inverse @ b, inverse @ b_gradient, rows @ inverse
    fastest = fastest_rate(ik, ic)
    kept = 1
    for k in range(same.size):
        kept = max(kept, same[k] + 2)
    made = np.zeros(kept, dtype=np.bool_)
    matrices = np.empty((kept, 2 * n, 2 * n))
    by_start, by_end = np.empty((kept, 2 * n, n)), np.empty((kept, 2 * n, n))
    which = np.full(same.size, -1)  # of the matrices each step takes; of a series none
    for k in range(same.size):
        if regular[k] or lengths[k] * fastest > _STIFF:
            u = which[k] = same[k] + 1
            if not made[u]:
                made[u], length = True, step if regular[k] else lengths[k]
                matrices[u], by_start[u], by_end[u] = step_matrices(ik, ic, length)
    room = np.empty(n * (n + 1)), np.empty((n, n)), np.empty(n), np.empty(n)
    steps = which, matrices, by_start, by_end, fastest
    return (ik, ic, held, quadratic, tilts), pushed, steps, room


@njit(cache=True, nogil=True, inline="always")
def lacking(
    y, force, own, push, held, quadratic, tilts, kinds, parameters, rows, pulls, states, given,
    products, square, rest, out, a,
):  # fmt: skip
    """What the linear equations lack, as an acceleration: into `out` (N,); all of it into `a`.

    y is (2N,); own (N,) is the force's own acceleration per newton, push (N, N) its change with y;
    held (N, 2N) springs beside dampers; quadratic and tilts as `packed` makes them; kinds,
    parameters, rows and states the elements', pulls (elements, N) M^-1 times their rows, given
    (elements,) forces that are known already;
    products (N (N + 1),), square (N, N) and rest (N,) are room to work in.
    """
    n = own.size
    pairs = n * (n + 1) // 2
    p = 0
    for j in range(n):
        for k in range(j + 1):
            products[p] = y[n + j] * y[n + k]
            products[pairs + p] = y[j] * y[k]
            p += 1
    for i in range(n):
        total = 0.0
        for q in range(2 * pairs):
            total -= quadratic[i, q] * products[q]
        pushed = 0.0
        linear = own[i] * force
        for j in range(n):
            pushed += push[i, j] * y[j]
            linear -= held[i, j] * y[j] + held[i, n + j] * y[n + j]
            tilt = 0.0
            for k in range(n):
                tilt += tilts[i, j, k] * y[k]
            square[i, j] = tilt
        rest[i] = total + pushed * force
        a[i] = linear
    if kinds is not None:
        for e in range(kinds.size):
            d = 0.0
            rate = 0.0
            for j in range(n):
                d += rows[e, j] * y[j]
                rate += rows[e, j] * y[n + j]
            pull = given[e] + element_force(kinds[e], parameters[e], d, rate, states[e])
            for j in range(n):
                rest[j] += pulls[e, j] * pull
    for i in range(n):
        out[i] = a[i] + rest[i]
    # x'' stands on both sides; two rounds leave (dM/M)^3.
    for turn in range(2):
        for i in range(n):
            total = rest[i]
            for j in range(n):
                total -= square[i, j] * out[j]
            products[i] = total
        if turn == 0:
            for i in range(n):
                out[i] = a[i] + products[i]
    for i in range(n):
        out[i] = products[i]
        a[i] += products[i]


@njit(cache=True, nogil=True)
def advance(kinds, parameters, rows, before, after, states, new_states):
    """The elements' inner states after the motion from one state (2N,) to another."""
    for e in range(kinds.size):
        new_states[e] = states[e]
        if kinds[e] == _BOUC_WEN:
            change = 0.0
            for j in range(rows.shape[1]):
                change += rows[e, j] * (after[j] - before[j])
            new_states[e] = advance_state(parameters[e], change, states[e])


@njit(cache=True, nogil=True)
def add_kink(start, end, length, row, pull, kind, parameters, bend, first, final):
    """Put what an element does between two states (2N,) into its line; whether it meets no kink."""
    n = row.size
    d0, rate0, d1, rate1 = 0.0, 0.0, 0.0, 0.0
    for j in range(n):
        d0 += row[j] * start[j]
        rate0 += row[j] * start[n + j]
        d1 += row[j] * end[j]
        rate1 += row[j] * end[n + j]
    straight = kink_correction(kind, parameters, d0, rate0, d1, rate1, length, bend)
    for j in range(n):
        first[j] += pull[j] * bend[0]
        final[j] += pull[j] * bend[1]
    return straight


@njit(cache=True, nogil=True)
def integrate(
    start, mass, gradient, curvature, damping, stiffness, b, b_gradient,
    kinds, parameters, rows, start_states,
    step, lengths, regular, same, force0, force1, sample, force_after,
    x_out, v_out, a_out, end,
):  # fmt: skip
    """Advance from `start` over all steps and write the samples.

    `start` is (2N,), deflections and rates; mass, gradient, curvature, damping, stiffness, b and
    b_gradient are the system's; kinds, parameters and rows its nonlinear elements', of which none
    is friction, start_states their inner states; kinds None where there are none, for which this
    is compiled once more, without them. Each of the K steps has a length (s), is `regular` where
    that is `step`, or has a number that equal lengths share (`same`); it has a straight line
    through its force (force0 to force1, N), and a sample number at its end, or -1; force_after is
    the force just after it. Written are x_out, v_out, a_out (samples, N) and end
    (2N + elements,), the last state.
    """
    n = b.size
    equations, pushed, steps, room = _prepared(
        mass, gradient, curvature, damping, stiffness, b, b_gradient, rows, step, lengths, regular,
        same,
    )  # fmt: skip
    ik, ic, held, quadratic, tilts = equations
    own, push, pulls = pushed
    which, matrices, by_start, by_end, fastest = steps
    products, square, rest, a = room
    states, new_states = start_states.copy(), start_states.copy()
    given = np.zeros(states.size)
    y, new, there = start.copy(), np.empty(2 * n), np.empty(2 * n)
    p0, p1, f0, f1, bend = np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(2)
    at_first, at_last, first, final = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    last = 0.0  # length of the step over which nothing jumped; 0 where something did
    for k in range(lengths.size):
        length = lengths[k]
        if last == 0.0:
            lacking(
                y, force0[k], own, push, held, quadratic, tilts, kinds, parameters, rows, pulls,
                states, given, products, square, rest, p1, a,
            )  # fmt: skip
            for i in range(n):
                p0[i] = p1[i]
        share = length / last if last > 0.0 else 0.0
        for i in range(n):
            # p1 is what was lacking at the end of the last step, p0 at its start.
            at_first[i] = p1[i]
            at_last[i] = p1[i] + share * (p1[i] - p0[i])
            p0[i] = p1[i]
        # Two evaluations after a jump, from which nothing can be extrapolated, and about a kink.
        u = which[k]
        matrix, at_start, at_end, by_matrix = matrices[u], by_start[u], by_end[u], u >= 0
        for _look in range(2):
            for i in range(n):
                f0[i] = own[i] * force0[k] + at_first[i]
                f1[i] = own[i] * force1[k] + at_last[i]
            if by_matrix:
                for i in range(2 * n):
                    total = 0.0
                    for j in range(n):
                        total += matrix[i, j] * y[j] + matrix[i, n + j] * y[n + j]
                        total += at_start[i, j] * f0[j] + at_end[i, j] * f1[j]
                    new[i] = total
            else:
                taylor(y, f0, f1, length, ik, ic, fastest, new)
            if kinds is not None:
                advance(kinds, parameters, rows, y, new, states, new_states)
            lacking(
                new, force1[k], own, push, held, quadratic, tilts, kinds, parameters, rows, pulls,
                new_states, given, products, square, rest, p1, a,
            )  # fmt: skip
            for i in range(n):
                first[i], final[i] = p0[i], p1[i]
            crossed = False
            if kinds is not None:
                for e in range(kinds.size):
                    if kinds[e] != _BOUC_WEN and kinds[e] != COULOMB:
                        straight = add_kink(
                            y, new, length, rows[e], pulls[e], kinds[e], parameters[e], bend,
                            first, final,
                        )  # fmt: skip
                        crossed = crossed or not straight
            if by_matrix:
                for i in range(2 * n):
                    total = new[i]
                    for j in range(n):
                        total += at_start[i, j] * (first[j] - at_first[j])
                        total += at_end[i, j] * (final[j] - at_last[j])
                    there[i] = total
            else:
                for i in range(n):
                    f0[i] = own[i] * force0[k] + first[i]
                    f1[i] = own[i] * force1[k] + final[i]
                taylor(y, f0, f1, length, ik, ic, fastest, there)
            if share > 0.0 and not crossed:
                break
            for i in range(n):
                at_first[i], at_last[i] = first[i], final[i]
        if kinds is not None:
            advance(kinds, parameters, rows, y, there, states, new_states)
            for e in range(kinds.size):
                states[e] = new_states[e]
        for i in range(2 * n):
            y[i] = there[i]
        jumped = crossed or force_after[k] != force1[k]
        if k + 1 < lengths.size:
            jumped = jumped or force0[k + 1] != force1[k]
        last = 0.0 if jumped else length
        s = sample[k]
        if s >= 0:
            if jumped:
                lacking(
                    y, force_after[k], own, push, held, quadratic, tilts, kinds, parameters, rows,
                    pulls, states, given, products, square, rest, p1, a,
                )  # fmt: skip
            else:
                for i in range(n):
                    total = own[i] * force1[k] + p1[i]
                    for j in range(n):
                        total -= held[i, j] * y[j] + held[i, n + j] * y[n + j]
                    a[i] = total
            x_out[s], v_out[s], a_out[s] = y[:n], y[n:], a
    end[: 2 * n] = y
    end[2 * n :] = states


@njit(cache=True, nogil=True)
def integrate_with_friction(
    start, mass, gradient, curvature, damping, stiffness, b, b_gradient,
    kinds, parameters, rows, start_states,
    step, lengths, regular, same, force0, force1, sample, force_after,
    x_out, v_out, a_out, end,
):  # fmt: skip
    """As `integrate`, where there is friction among the elements."""
    n, elements = b.size, kinds.size
    equations, pushed, steps, room = _prepared(
        mass, gradient, curvature, damping, stiffness, b, b_gradient, rows, step, lengths, regular,
        same,
    )  # fmt: skip
    ik, ic, held, quadratic, tilts = equations
    own, push, pulls = pushed
    which, matrices, by_start, by_end, fastest = steps
    products, square, rest, a = room
    states, new_states = start_states.copy(), start_states.copy()
    friction, last, given = np.zeros(elements), np.zeros(elements), np.zeros(elements)
    y, new, zero = start.copy(), np.empty(2 * n), np.zeros(2 * n)
    p0, p1, f0, f1, bend = np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(2)
    kick = np.empty((elements, 2 * n))
    for k in range(lengths.size):
        # Friction is in the step itself, as `stick` finds it: the pseudo-force must not count it.
        given[:] = 0.0
        lacking(
            y, force0[k], own, push, held, quadratic, tilts, kinds, parameters, rows, pulls,
            states, given, products, square, rest, p0, a,
        )  # fmt: skip
        for i in range(n):
            f0[i] = own[i] * force0[k] + p0[i]
            f1[i] = own[i] * force1[k] + p0[i]
        u = which[k]
        matrix, at_start, at_end, by_matrix = matrices[u], by_start[u], by_end[u], u >= 0
        for e in range(elements):  # what a unit of friction all through the step does
            if kinds[e] == COULOMB and by_matrix:
                for i in range(2 * n):
                    total = 0.0
                    for j in range(n):
                        total += (at_start[i, j] + at_end[i, j]) * pulls[e, j]
                    kick[e, i] = total
            elif kinds[e] == COULOMB:
                taylor(zero, pulls[e], pulls[e], lengths[k], ik, ic, fastest, kick[e])
        for attempt in range(2):
            if by_matrix:
                for i in range(2 * n):
                    total = 0.0
                    for j in range(2 * n):
                        total += matrix[i, j] * y[j]
                    for j in range(n):
                        total += at_start[i, j] * f0[j] + at_end[i, j] * f1[j]
                    new[i] = total
            else:
                taylor(y, f0, f1, lengths[k], ik, ic, fastest, new)
            stick(y, new, kinds, parameters, rows, kick, friction, last)
            advance(kinds, parameters, rows, y, new, states, new_states)
            if attempt == 1:
                break
            lacking(
                new, force1[k], own, push, held, quadratic, tilts, kinds, parameters, rows, pulls,
                new_states, given, products, square, rest, p1, a,
            )  # fmt: skip
            for i in range(n):
                f1[i] = own[i] * force1[k] + p1[i]
            for e in range(elements):
                if kinds[e] != _BOUC_WEN and kinds[e] != COULOMB:
                    add_kink(
                        y, new, lengths[k], rows[e], pulls[e], kinds[e], parameters[e], bend, f0,
                        f1,
                    )  # fmt: skip
        y[:] = new
        states[:] = new_states
        if sample[k] >= 0:
            s = sample[k]
            for e in range(elements):
                given[e] = -last[e] if kinds[e] == COULOMB else 0.0
            lacking(
                y, force_after[k], own, push, held, quadratic, tilts, kinds, parameters, rows,
                pulls, states, given, products, square, rest, p1, a,
            )  # fmt: skip
            x_out[s], v_out[s], a_out[s] = y[:n], y[n:], a
    end[: 2 * n] = y
    end[2 * n :] = states
