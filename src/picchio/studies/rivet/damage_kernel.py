"""Compiled damage of a rivet at many poses: exact response, rainflow, S-N curve, Miner's sum."""

from __future__ import annotations

import numpy as np
from numba import njit

from picchio.core.arrays import FloatArray
from picchio.fatigue.counting.kernel import finish, push
from picchio.vibration.batch.modal_kernel import decompose, modes_of
from picchio.vibration.batch.turning_kernel import turns_from_rest

SPAN = 16  # rivets that a thread takes at a time


@njit(cache=True, error_model="numpy")
def cost_of(amplitude: float, knots: FloatArray, lines: FloatArray) -> float:
    """Damage of one cycle: one over its life.

    Args:
        amplitude: Pa.
        knots: (k,) Pa, falling; see `curve_tables`.
        lines: (k + 1, 3): cycles and amplitude of a point on each line, and its slope.
    """
    line = 0
    while line < knots.shape[0] and knots[line] > amplitude:
        line += 1
    slope = lines[line, 2]
    if amplitude <= 0.0:
        return 0.0
    ratio = amplitude / lines[line, 1]
    if slope == np.inf:
        return 0.0
    return np.exp(slope * np.log(ratio)) / lines[line, 0]


@njit(cache=True, error_model="numpy")
def cycles_damage(ranges, count, factor, knots, lines):  # type: ignore[no-untyped-def]
    """Miner's sum of closed cycles.

    Args:
        ranges: (r,) any unit.
        count: how many of them are in use.
        factor: Pa per that unit.
        knots: see `cost_of`.
        lines: see `cost_of`.
    """
    total = 0.0
    for c in range(count):
        total += cost_of(0.5 * factor * ranges[c], knots, lines)
    return total


@njit(cache=True, error_model="numpy")
def residue_damage(stack, first, end, factor, knots, lines):  # type: ignore[no-untyped-def]
    """Miner's sum of a part of a residue, its ranges as half cycles.

    Args:
        stack: (r,) turning points, any unit.
        first: of the part.
        end: the one after its last.
        factor: Pa per that unit.
        knots: see `cost_of`.
        lines: see `cost_of`.
    """
    total = 0.0
    for c in range(first, end - 1):
        total += 0.5 * cost_of(0.5 * factor * abs(stack[c + 1] - stack[c]), knots, lines)
    return total


@njit(cache=True, error_model="numpy")
def history_damage(turns, factor, knots, lines, stack, ranges, means):  # type: ignore[no-untyped-def]
    """Miner's sum of a history: closed cycles whole, the residue as half cycles.

    Args:
        turns: (t,) turning points, any unit.
        factor: Pa per that unit.
        knots: see `cost_of`.
        lines: see `cost_of`.
        stack: at least (t,), scratch.
        ranges: at least (t // 2 + 1,), scratch.
        means: likewise.
    """
    depth, closed = push(turns, stack, 0, ranges, means)
    total = cycles_damage(ranges, closed, factor, knots, lines)
    depth, closed = finish(stack, depth, ranges, means)
    total += cycles_damage(ranges, closed, factor, knots, lines)
    return total + residue_damage(stack, 0, depth, factor, knots, lines)


@njit(cache=True, error_model="numpy")
def swing(  # type: ignore[no-untyped-def]
    mass, jacobian, stiffness, joint_ratio, along, limit, duration, constant, slope, amplitude,
    wave, frequency, per_cycle,
):  # fmt: skip
    """Every joint's turning points from rest, ring-down included.

    Args:
        mass: (n, n) kg m^2.
        jacobian: (3, n) m.
        stiffness: (n,) N m/rad.
        joint_ratio: (n,) damping ratios.
        along: (3,) force direction.
        limit: (n,) rad; see `turns_from_rest`.
        duration: (m,) s, of the pieces of the burst; see `damages` for these.
        constant: (m,) N.
        slope: (m,) N/s.
        amplitude: (m,) complex N.
        wave: (m,) rad/s.
        frequency: (n,) Hz, out; left alone where the mass matrix is not positive definite.
        per_cycle: see `turns_from_rest`.

    Returns:
        (n, k) rad, and how many of the k each joint has; none of either where a mode is not
        underdamped.
    """
    n = stiffness.shape[0]
    values, vectors = np.empty((n, n, 1)), np.empty((n, n, 1))
    omega, shapes, weights = np.empty(n), np.empty((n, n)), np.empty((n, n))
    poles = np.empty(n, dtype=np.complex128)
    decompose(mass.reshape((1, n, n)), stiffness.reshape((1, n)), values, vectors)
    if not modes_of(0, values, vectors, stiffness, joint_ratio, omega, shapes, frequency, poles):
        return np.empty((0, 0)), np.empty(0, dtype=np.int64)
    for i in range(n):
        moved = 0.0
        for d in range(3):
            for j in range(n):
                moved += jacobian[d, j] * shapes[j, i] * along[d]
        for j in range(n):
            weights[j, i] = shapes[j, i] * moved
    return turns_from_rest(
        poles, weights, limit, duration, constant, slope, amplitude, wave, per_cycle
    )


@njit(cache=True, nogil=True, error_model="numpy")
def damages(  # type: ignore[no-untyped-def]
    first, last, duration, constant, slope, amplitude, wave, mass, jacobian, blows, place,
    stiffness, joint_ratio, along, factor, enough, knots, lines, known, frequency, lowest, highest,
    damage, per_cycle,
):  # fmt: skip
    """Extremes and damage of p rivets: at many poses, or one varied many times.

    Args:
        first: of the rivets.
        last: the one after the last.
        duration: (b, m) s, of the pieces of b bursts, the last endless; see `PiecewiseForce`.
        constant: (b, m) N.
        slope: (b, m) N/s.
        amplitude: (b, m) complex N.
        wave: (b, m) rad/s.
        mass: (q, n, n) kg m^2.
        jacobian: (q, 3, n) m.
        blows: (p,) which of the bursts.
        place: (p,) which of the masses and Jacobians.
        stiffness: (p, n) N m/rad.
        joint_ratio: (p, n) damping ratios.
        along: (q, 3) force directions.
        factor: (p, n) 1/m^3, shear stress per torque; zero without a shaft.
        enough: (n,) Pa, amplitudes below this do no damage.
        knots: (n, k) Pa, of the S-N curves; see `cost_of`.
        lines: (n, k + 1, 3).
        known: (n,) how many of the k knots a curve has; below zero for a joint without one.
        frequency: (p, n) Hz, NaN, out; left so where the mass matrix is not positive definite.
        lowest: (p, n) rad, NaN, out; left so where a mode is not underdamped, or rings for too
            long: take the exact path there.
        highest: (p, n) rad, out.
        damage: (p, n) out; zero for a joint without a curve.
        per_cycle: see `turns_from_rest`.
    """
    n = stiffness.shape[1]
    limit = np.empty(n)
    for s in range(first, last):
        for j in range(n):
            stress = factor[s, j] * stiffness[s, j]
            limit[j] = 2.0 * enough[j] / stress if stress > 0.0 else np.inf
        q, b = place[s], blows[s]
        turns, count = swing(
            mass[q], jacobian[q], stiffness[s], joint_ratio[s], along[q], limit,
            duration[b], constant[b], slope[b], amplitude[b], wave[b], frequency[s],
            per_cycle,
        )  # fmt: skip
        size = turns.shape[1]
        if size == 0:
            continue
        stack, ranges, means = np.empty(size), np.empty(size), np.empty(size)
        for j in range(n):
            own = turns[j, : count[j]]
            lowest[s, j], highest[s, j] = own.min(), own.max()
            damage[s, j] = 0.0
            if known[j] >= 0 and highest[s, j] - lowest[s, j] >= limit[j]:
                damage[s, j] = history_damage(
                    own, factor[s, j] * stiffness[s, j], knots[j, : known[j]],
                    lines[j, : known[j] + 1], stack, ranges, means,
                )  # fmt: skip
