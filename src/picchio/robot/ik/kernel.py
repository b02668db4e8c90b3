"""Compiled inverse kinematics: damped least squares with limits, over many starts and points.

Levenberg-Marquardt on the distance to the point, and on the angle to the wanted axis where one
is given. A joint that a step would push through its limit is held there for this step.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from picchio.robot.ik.chain_kernel import (
    cholesky_solve,
    copy,
    copy_matrix,
    forward,
    gap,
    normal_equations,
    square,
)

STEPS = 100
"""More than any descent took that ended at its point."""


@njit(cache=True)
def descend(tables, q, lower, upper, target, axis, weight, steps):  # type: ignore[no-untyped-def]
    """Move q (k,) in place to the nearest minimum; return the residual's norm in m."""
    k = q.shape[0]
    residual, trial_residual = np.empty(6), np.empty(6)
    jacobian, trial_jacobian = np.empty((6, k)), np.empty((6, k))
    normal, system = np.empty((k, k)), np.empty((k, k))
    gradient, step, trial = np.empty(k), np.empty(k), np.empty(k)
    forward(tables, q, residual, jacobian, target, axis, weight)
    cost = square(residual)
    damping = 1e-3
    for _ in range(steps):
        if cost < 1e-24:
            break
        largest = normal_equations(jacobian, residual, normal, gradient)
        for j in range(k):
            at_lower = q[j] <= lower[j] and gradient[j] > 0.0
            at_upper = q[j] >= upper[j] and gradient[j] < 0.0
            if at_lower or at_upper:
                for i in range(k):
                    normal[i, j] = normal[j, i] = 0.0
                gradient[j] = 0.0
                normal[j, j] = largest
        if np.sqrt(square(gradient)) < 1e-14 * largest:
            break
        improved = False
        trial_cost = cost
        while damping < 1e8:
            copy_matrix(normal, system)
            for j in range(k):
                system[j, j] += damping * largest
                step[j] = gradient[j]
            cholesky_solve(system, step)
            for j in range(k):
                trial[j] = min(max(q[j] - step[j], lower[j]), upper[j])
            forward(tables, trial, trial_residual, trial_jacobian, target, axis, weight)
            trial_cost = square(trial_residual)
            if trial_cost < cost:
                improved = True
                break
            damping *= 10.0
        if not improved:
            break
        stalled = cost - trial_cost < 1e-13 * cost and cost > 1e-16
        copy(trial, q)
        copy(trial_residual, residual)
        copy_matrix(trial_jacobian, jacobian)
        cost = trial_cost
        damping = max(damping * 0.1, 1e-15)
        if stalled:
            break
    return np.sqrt(cost)


@njit(cache=True)
def along_self_motion(jacobian, wish, held, step):  # type: ignore[no-untyped-def]
    """Project `wish` (k,) onto the motions that keep the tool still; `held` joints stand."""
    rows, k = jacobian.shape
    gram, load = np.zeros((rows, rows)), np.zeros(rows)
    trace = 1e-12
    for r in range(rows):
        for c in range(r + 1):
            for j in range(k):
                if not held[j]:
                    gram[r, c] += jacobian[r, j] * jacobian[c, j]
            gram[c, r] = gram[r, c]
        trace += gram[r, r]
        for j in range(k):
            if not held[j]:
                load[r] += jacobian[r, j] * wish[j]
    for r in range(rows):
        gram[r, r] += 1e-12 * trace
    cholesky_solve(gram, load)
    for j in range(k):
        step[j] = 0.0
        if not held[j]:
            step[j] = wish[j]
            for r in range(rows):
                step[j] -= jacobian[r, j] * load[r]


@njit(cache=True)
def relax(tables, q, centre, lower, upper, target, axis, weight, steps):  # type: ignore[no-untyped-def]
    """Move q (k,) in place along its self-motion towards `centre`, the tool standing still."""
    k = q.shape[0]
    residual, jacobian = np.empty(6), np.empty((6, k))
    wish, step, trial = np.empty(k), np.empty(k), np.empty(k)
    held = np.zeros(k, dtype=np.bool_)
    for _ in range(steps):
        forward(tables, q, residual, jacobian, target, axis, weight)
        for j in range(k):
            wish[j] = centre[j] - q[j]
        before = square(wish)
        for j in range(k):
            held[j] = False
        for _again in range(k):
            along_self_motion(jacobian, wish, held, step)
            pushed = False
            for j in range(k):
                out = (q[j] <= lower[j] and step[j] < -1e-12) or (
                    q[j] >= upper[j] and step[j] > 1e-12
                )
                if out and not held[j]:
                    held[j] = True
                    pushed = True
            if not pushed:
                break
        length = np.sqrt(square(step))
        if length < 1e-5:
            break
        share = min(0.5, 0.3 / length)
        nearer = False
        # The way curves: where a step ends no nearer, a shorter one does.
        for _shorter in range(8):
            for j in range(k):
                trial[j] = min(max(q[j] + share * step[j], lower[j]), upper[j])
            error = descend(tables, trial, lower, upper, target, axis, weight, steps // 5)
            nearer = error < 1e-8 and gap(centre, trial) < before
            if nearer:
                break
            share *= 0.4
        if not nearer:
            break
        copy(trial, q)


@njit(cache=True)
def unwind(q, centre, wraps, lower, upper):  # type: ignore[no-untyped-def]
    """Take full turns off q (k,) in place, towards `centre`, where the limits let them go."""
    turn = 2.0 * np.pi
    for j in range(q.shape[0]):
        if wraps[j]:
            nearer = q[j] - turn * np.round((q[j] - centre[j]) / turn)
            if lower[j] <= nearer <= upper[j]:
                q[j] = nearer


@njit(cache=True)
def solve_points(  # type: ignore[no-untyped-def]
    tables,
    starts,
    centre,
    wraps,
    lower,
    upper,
    targets,
    axes,
    weight,
    redundant,
    steps,
    found,
    errors,
):
    """Every start at every point.

    Args:
        tables: see `forward`.
        starts: (s, k) first guesses.
        centre: (k,) where redundant arms rest.
        wraps: (k,) true for angles.
        lower: (k,) limits.
        upper: (k,) limits.
        targets: (p, 3) m.
        axes: (p, 3) unit.
        weight: m; zero leaves the axis free.
        redundant: move solutions along their self-motion towards the centre.
        steps: of a descent, and along a self-motion: `STEPS`. (A number that stands in compiled
            text is a type of its own to Numba: it would compile the descent for each.)
        found: (p, s, k) out: where each start ended.
        errors: (p, s) out: distance left, m.
    """
    q = np.empty(starts.shape[1])
    for p in range(targets.shape[0]):
        for s in range(starts.shape[0]):
            copy(starts[s], q)
            error = descend(tables, q, lower, upper, targets[p], axes[p], weight, steps)
            unwind(q, centre, wraps, lower, upper)
            if redundant and error < 1e-8:
                relax(tables, q, centre, lower, upper, targets[p], axes[p], weight, steps)
            copy(q, found[p, s])
            errors[p, s] = error
