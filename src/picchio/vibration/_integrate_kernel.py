"""Compiled time integration: the linear part exact, everything else as a pseudo-force.

y = (x, x') obeys y' = A y + B (b F(t) + p(t, y)). The linear part is advanced by the matrix
exponential; bF and p are taken as straight lines over a step (exponential predictor-corrector,
Hochbruck and Ostermann, Acta Numerica 19 (2010) 209, doi:10.1017/S0962492910000048). Steps that
a force edge cuts short are advanced by the Taylor series of the same exponential.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

import numpy as np
from numba import njit

from picchio.vibration._element_kernel import advance_state, element_force

_COULOMB = 3
_FRICTION_SWEEPS = 4
_IDEAL = 2e-5  # rad/s, below which friction is taken as ideal
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
def _fastest(ik, ic):
    """A bound of the system's rates, 1/s."""
    most = 0.0
    for i in range(ik.shape[0]):
        most = max(most, np.sqrt(np.abs(ik[i]).sum()) + np.abs(ic[i]).sum())
    return most


@njit(cache=True, nogil=True)
def _taylor(y, f0, f1, length, inverse, ik, ic, fastest, out):
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


@njit(cache=True, nogil=True)
def _pseudo_force(
    x, v, force, mass, gradient, curvature, inverse, damping, stiffness, b, b_gradient,
    kinds, parameters, rows, states, friction, out,
):  # fmt: skip
    """What the linear equations lack: M x'' = b F + p - C x' - K x. Into `out` (N,)."""
    n = x.size
    rest = np.empty(n)
    tilt = np.zeros((n, n))
    rate = np.zeros((n, n))
    for k in range(n):
        for i in range(n):
            for j in range(n):
                tilt[i, j] += gradient[k, i, j] * x[k]
                rate[i, j] += gradient[k, i, j] * v[k]
    linear = np.empty(n)
    for i in range(n):
        total = 0.0
        quadratic = 0.0
        curved = 0.0
        push = 0.0
        held = 0.0
        for j in range(n):
            total += rate[i, j] * v[j]
            inner = 0.0
            bent = 0.0
            for k in range(n):
                inner += gradient[i, j, k] * v[k]
                bent += curvature[k, i, j] * x[k]
            quadratic += inner * v[j]
            curved += bent * x[j]
            push += b_gradient[i, j] * x[j]
            held += damping[i, j] * v[j] + stiffness[i, j] * x[j]
        rest[i] = push * force - total + 0.5 * quadratic - 0.5 * curved
        linear[i] = b[i] * force - held
    for e in range(kinds.size):
        d = 0.0
        dd = 0.0
        for j in range(n):
            d += rows[e, j] * x[j]
            dd += rows[e, j] * v[j]
        if kinds[e] == _COULOMB:
            torque = -friction[e]
        else:
            torque = element_force(kinds[e], parameters[e], d, dd, states[e])
        for j in range(n):
            rest[j] += rows[e, j] * torque
    # x'' stands on both sides; two rounds leave (dM/M)^3.
    acceleration = np.empty(n)
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += inverse[i, j] * (linear[j] + rest[j])
        acceleration[i] = total
    for _ in range(2):
        for i in range(n):
            total = rest[i]
            for j in range(n):
                total -= tilt[i, j] * acceleration[j]
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
    step, lengths, regular, force0, force1, sample, force_after,
    x_out, v_out, a_out, end,
):  # fmt: skip
    """Advance from `start` over all steps and write the samples.

    `start` is (2N,), deflections and rates; mass, gradient, curvature, damping, stiffness, b and
    b_gradient are the system's; kinds, parameters and rows its nonlinear elements', start_states
    their inner states. Each of the K steps has a length (s), is `regular` where that is `step`,
    has a straight line through its force (force0 to force1, N), and a sample number at its end,
    or -1; force_after is the force just after it. Written are x_out, v_out, a_out (samples, N)
    and end (2N + elements,), the last state.
    """
    n = b.size
    inverse = np.linalg.inv(mass)
    ik, ic = inverse @ stiffness, inverse @ damping
    fastest = _fastest(ik, ic)
    exponential, from_start, from_end = step_matrices(inverse, damping, stiffness, step)
    elements = kinds.size
    y = start.copy()
    states = start_states.copy()
    friction = np.zeros(elements)
    has_friction = False
    for e in range(elements):
        has_friction = has_friction or kinds[e] == _COULOMB
    p0, p1, f0, f1 = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    guess, new = np.empty(2 * n), np.empty(2 * n)
    new_states = states.copy()
    kick = np.empty((elements, 2 * n))
    zero = np.zeros(2 * n)
    for k in range(lengths.size):
        if has_friction:
            for e in range(elements):
                friction[e] = 0.0
        _pseudo_force(
            y[:n], y[n:], force0[k], mass, gradient, curvature, inverse, damping, stiffness,
            b, b_gradient, kinds, parameters, rows, states, friction, p0,
        )  # fmt: skip
        for i in range(n):
            f0[i] = b[i] * force0[k] + p0[i]
            f1[i] = b[i] * force1[k] + p0[i]
        for attempt in range(2):
            if regular[k]:
                for i in range(2 * n):
                    total = 0.0
                    for j in range(2 * n):
                        total += exponential[i, j] * y[j]
                    for j in range(n):
                        total += from_start[i, j] * f0[j] + from_end[i, j] * f1[j]
                    new[i] = total
            else:
                _taylor(y, f0, f1, lengths[k], inverse, ik, ic, fastest, new)
            if has_friction:
                _stick(new, n, rows, kinds, parameters, friction, kick, zero, lengths[k],
                       regular[k], from_start, from_end, inverse, ik, ic, fastest)  # fmt: skip
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
                guess[:n], guess[n:], force1[k], mass, gradient, curvature, inverse, damping,
                stiffness, b, b_gradient, kinds, parameters, rows, new_states,
                np.zeros(elements), p1,
            )  # fmt: skip
            for i in range(n):
                f1[i] = b[i] * force1[k] + p1[i]
        for i in range(2 * n):
            y[i] = new[i]
        for e in range(elements):
            states[e] = new_states[e]
        if sample[k] >= 0:
            s = sample[k]
            acceleration = _pseudo_force(
                y[:n], y[n:], force_after[k], mass, gradient, curvature, inverse, damping,
                stiffness, b, b_gradient, kinds, parameters, rows, states, friction, p1,
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
def _stick(
    new, n, rows, kinds, parameters, friction, kick, zero, length, regular,
    from_start, from_end, inverse, ik, ic, fastest,
):  # fmt: skip
    """Dry friction that holds a joint still at the step's end where it can, else its limit."""
    for e in range(kinds.size):
        if kinds[e] != _COULOMB:
            continue
        if regular:
            for i in range(2 * n):
                total = 0.0
                for j in range(n):
                    total += (from_start[i, j] + from_end[i, j]) * rows[e, j]
                kick[e, i] = total
        else:
            _taylor(zero, rows[e], rows[e], length, inverse, ik, ic, fastest, kick[e])
        friction[e] = 0.0
    for _ in range(_FRICTION_SWEEPS):
        for e in range(kinds.size):
            if kinds[e] != _COULOMB:
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
