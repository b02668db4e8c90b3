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
# Sums may be taken in any order, several terms at once; what is no number stays none.
_REORDERED = {"reassoc", "contract", "nsz"}


@njit(cache=True, nogil=True)
def packed(inverse, gradient, curvature, push):
    """What is of second order, a pair of coordinates once.

    Returns:
        second (N, N (N + 2)), on the products of rates, of deflections, and of deflections and
        force: inertia's forces, gravity's curvature, the force's turning; tilts (N, N N), [k] on
        deflection k: the mass's change, row by row.
    """
    n = gradient.shape[0]
    pairs = n * (n + 1) // 2
    forces, tilts = np.empty((n, n * (n + 2))), np.zeros((n, n * n))
    for i in range(n):
        p = 0
        for j in range(n):
            for k in range(j + 1):
                rates = gradient[j, i, k] - 0.5 * gradient[i, j, k]
                bent = 0.5 * curvature[j, i, k]
                if j != k:
                    rates += gradient[k, i, j] - 0.5 * gradient[i, k, j]
                    bent += 0.5 * curvature[k, i, j]
                forces[i, p] = -rates
                forces[i, pairs + p] = -bent
                p += 1
        for j in range(n):
            forces[i, 2 * pairs + j] = push[i, j]
    for i in range(n):
        for j in range(n):
            for k in range(n):
                for m in range(n):
                    tilts[k, i * n + j] += inverse[i, m] * gradient[k, m, j]
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
    second, tilts = packed(inverse, gradient, curvature, b_gradient)
    pushed = inverse @ b, rows @ inverse
    fastest = fastest_rate(ik, ic)
    kept = 1
    for k in range(same.size):
        kept = max(kept, same[k] + 2)
    made = np.zeros(kept, dtype=np.bool_)
    matrices = np.empty((kept, 2 * n, 4 * n))  # on y, and on p at the start and the end
    which = np.full(same.size, -1)  # of the matrices each step takes; of a series none
    for k in range(same.size):
        if regular[k] or lengths[k] * fastest > _STIFF:
            u = which[k] = same[k] + 1
            if not made[u]:
                made[u], length = True, step if regular[k] else lengths[k]
                parts = step_matrices(ik, ic, length)
                matrices[u, :, : 2 * n] = parts[0]
                matrices[u, :, 2 * n : 3 * n], matrices[u, :, 3 * n :] = parts[1], parts[2]
    room = np.empty(n * (n + 2)), np.empty(n * n), np.empty(n), np.empty(n)
    return (ik, ic, held, second, tilts), pushed, (which, matrices, fastest), room


@njit(cache=True, nogil=True, inline="always", fastmath=_REORDERED)
def times(matrix, first, vector, out):
    """A matrix's columns from one on times a vector.

    Args:
        matrix: (m, first + k) or wider.
        first: the first of the columns.
        vector: (k,).
        out: (m,), where it goes.
    """
    for i in range(out.size):
        total = 0.0
        for q in range(vector.size):
            total += matrix[i, first + q] * vector[q]
        out[i] = total


@njit(cache=True, nogil=True, inline="always", fastmath=_REORDERED)
def lacking(
    y, force, own, held, second, tilts, kinds, parameters, rows, pulls, states, given,
    products, square, rest, out, a,
):  # fmt: skip
    """What the linear equations lack, as an acceleration: into `out` (N,); all of it into `a`.

    y is (2N,); own (N,) is the force's own acceleration per newton; held (N, 2N) springs beside
    dampers; second and tilts as `packed` makes them; kinds, parameters, rows and states the
    elements', pulls (elements, N) M^-1 times their rows, given (elements,) forces that are known
    already; products (N (N + 2),), square (N N,) and rest (N,) are room to work in.
    """
    n = own.size
    pairs = n * (n + 1) // 2
    p = 0
    for j in range(n):
        for k in range(j + 1):
            products[p] = y[n + j] * y[n + k]
            products[pairs + p] = y[j] * y[k]
            p += 1
        products[2 * pairs + j] = y[j] * force
    # Each sum in a loop of its own: a processor takes several terms of a long one at once.
    for i in range(n):
        total = 0.0
        for q in range(products.size):
            total += second[i, q] * products[q]
        rest[i] = total
    for i in range(n):
        total = 0.0
        for q in range(y.size):
            total += held[i, q] * y[q]
        a[i] = own[i] * force - total
    for q in range(square.size):
        square[q] = 0.0
    for k in range(n):
        bend = y[k]
        for q in range(square.size):
            square[q] += tilts[k, q] * bend
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
                total -= square[i * n + j] * out[j]
            products[i] = total
        if turn == 0:
            for i in range(n):
                out[i] = a[i] + products[i]
    for i in range(n):
        out[i] = products[i]
        a[i] += products[i]


@njit(cache=True, nogil=True, fastmath=_REORDERED)
def advance(kinds, parameters, rows, before, after, states, new_states):
    """The elements' inner states after the motion from one state (2N,) to another."""
    for e in range(kinds.size):
        new_states[e] = states[e]
        if kinds[e] == _BOUC_WEN:
            change = 0.0
            for j in range(rows.shape[1]):
                change += rows[e, j] * (after[j] - before[j])
            new_states[e] = advance_state(parameters[e], change, states[e])


@njit(cache=True, nogil=True, fastmath=_REORDERED)
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


@njit(cache=True, nogil=True, fastmath=_REORDERED)
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
    ik, ic, held, second, tilts = equations
    own, pulls = pushed
    which, matrices, fastest = steps
    products, square, rest, a = room
    states, new_states = start_states.copy(), start_states.copy()
    given = np.zeros(states.size)
    whole, new, there = np.empty(4 * n), np.empty(2 * n), np.empty(2 * n)
    y, f0, f1, moved = whole[: 2 * n], whole[2 * n : 3 * n], whole[3 * n :], np.empty(2 * n)
    y[:] = start
    p0, p1, bend = np.empty(n), np.empty(n), np.empty(2)
    at_first, at_last, first, final = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    last = 0.0  # length of the step over which nothing jumped; 0 where something did
    for k in range(lengths.size):
        length = lengths[k]
        if last == 0.0:
            lacking(
                y, force0[k], own, held, second, tilts, kinds, parameters, rows, pulls,
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
        matrix, by_matrix = matrices[which[k]], which[k] >= 0
        for _look in range(2):
            for i in range(n):
                f0[i] = own[i] * force0[k] + at_first[i]
                f1[i] = own[i] * force1[k] + at_last[i]
            if by_matrix:
                times(matrix, 0, whole, new)
            else:
                taylor(y, f0, f1, length, ik, ic, fastest, new)
            if kinds is not None:
                advance(kinds, parameters, rows, y, new, states, new_states)
            lacking(
                new, force1[k], own, held, second, tilts, kinds, parameters, rows, pulls,
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
                for i in range(n):
                    moved[i], moved[n + i] = first[i] - at_first[i], final[i] - at_last[i]
                times(matrix, 2 * n, moved, there)
                for i in range(2 * n):
                    there[i] += new[i]
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
                    y, force_after[k], own, held, second, tilts, kinds, parameters, rows,
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


@njit(cache=True, nogil=True, fastmath=_REORDERED)
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
    ik, ic, held, second, tilts = equations
    own, pulls = pushed
    which, matrices, fastest = steps
    products, square, rest, a = room
    states, new_states = start_states.copy(), start_states.copy()
    friction, last, given = np.zeros(elements), np.zeros(elements), np.zeros(elements)
    whole, new, zero, even = np.empty(4 * n), np.empty(2 * n), np.zeros(2 * n), np.empty(2 * n)
    y, f0, f1 = whole[: 2 * n], whole[2 * n : 3 * n], whole[3 * n :]
    y[:] = start
    p0, p1, bend = np.empty(n), np.empty(n), np.empty(2)
    kick = np.empty((elements, 2 * n))
    for k in range(lengths.size):
        # Friction is in the step itself, as `stick` finds it: the pseudo-force must not count it.
        given[:] = 0.0
        lacking(
            y, force0[k], own, held, second, tilts, kinds, parameters, rows, pulls,
            states, given, products, square, rest, p0, a,
        )  # fmt: skip
        for i in range(n):
            f0[i] = own[i] * force0[k] + p0[i]
            f1[i] = own[i] * force1[k] + p0[i]
        matrix, by_matrix = matrices[which[k]], which[k] >= 0
        for e in range(elements):  # what a unit of friction all through the step does
            if kinds[e] == COULOMB and by_matrix:
                even[:n], even[n:] = pulls[e], pulls[e]
                times(matrix, 2 * n, even, kick[e])
            elif kinds[e] == COULOMB:
                taylor(zero, pulls[e], pulls[e], lengths[k], ik, ic, fastest, kick[e])
        for attempt in range(2):
            if by_matrix:
                times(matrix, 0, whole, new)
            else:
                taylor(y, f0, f1, lengths[k], ik, ic, fastest, new)
            stick(y, new, kinds, parameters, rows, kick, friction, last)
            advance(kinds, parameters, rows, y, new, states, new_states)
            if attempt == 1:
                break
            lacking(
                new, force1[k], own, held, second, tilts, kinds, parameters, rows, pulls,
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
                y, force_after[k], own, held, second, tilts, kinds, parameters, rows,
                pulls, states, given, products, square, rest, p1, a,
            )  # fmt: skip
            x_out[s], v_out[s], a_out[s] = y[:n], y[n:], a
    end[: 2 * n] = y
    end[2 * n :] = states
