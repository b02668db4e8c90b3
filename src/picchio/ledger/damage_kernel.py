"""Compiled damage of bursts whose forces and poses all differ, at several scales of the load."""

from __future__ import annotations

import numpy as np
from numba import njit

from picchio.core.arrays import FloatArray
from picchio.fatigue.counting.kernel import finish, push
from picchio.studies.rivet.damage_kernel import cycles_damage, residue_damage, swing
from picchio.vibration.batch.turning_kernel import FINE

MOST = 96
"""Turning points of a residue that are kept."""
# What is left of a residue's ends counts as half cycles; ranges below this share do no more.
_SMALL = 0.01


@njit(cache=True, error_model="numpy")
def akima(time: FloatArray, values: FloatArray, finer: int) -> tuple[FloatArray, FloatArray]:
    """A curve through samples, at `finer` times as many times: Akima, J. ACM 17 (1970) 589-602.

    Args:
        time: (m,) ascending, five or more.
        values: (m,) there.
        finer: steps in each interval.

    Returns:
        the times and values, (finer (m - 1) + 1,) each.
    """
    m = time.shape[0]
    slope = np.empty(m + 3)
    for i in range(m - 1):
        slope[i + 2] = (values[i + 1] - values[i]) / (time[i + 1] - time[i])
    slope[1] = 2.0 * slope[2] - slope[3]
    slope[0] = 2.0 * slope[1] - slope[2]
    slope[m + 1] = 2.0 * slope[m] - slope[m - 1]
    slope[m + 2] = 2.0 * slope[m + 1] - slope[m]
    rise, top = np.empty(m), np.abs(slope).max()
    for i in range(m):
        before, after = abs(slope[i + 1] - slope[i]), abs(slope[i + 3] - slope[i + 2])
        # As scipy has it: where both vanish, the mean.
        if before + after > 1e-9 * top:
            rise[i] = (after * slope[i + 1] + before * slope[i + 2]) / (before + after)
        else:
            rise[i] = 0.5 * (slope[i + 3] + slope[i])
    when, what = np.empty(finer * (m - 1) + 1), np.empty(finer * (m - 1) + 1)
    for i in range(m - 1):
        h = time[i + 1] - time[i]
        c = (3.0 * slope[i + 2] - 2.0 * rise[i] - rise[i + 1]) / h
        d = (rise[i] + rise[i + 1] - 2.0 * slope[i + 2]) / (h * h)
        for k in range(finer):
            u = h * k / finer
            when[finer * i + k] = time[i] + u
            what[finer * i + k] = values[i] + u * (rise[i] + u * (c + u * d))
    when[-1], what[-1] = time[-1], values[-1]
    return when, what


@njit(cache=True, error_model="numpy")
def trimmed(residue, depth):  # type: ignore[no-untyped-def]
    """The part of a residue whose ranges matter: first point and end.

    A residue diverges, then converges: its small ranges stand at its ends.

    Args:
        residue: (r,) turning points.
        depth: how many are in use.

    Returns:
        the two indices.
    """
    top = 0.0
    for c in range(depth - 1):
        top = max(top, abs(residue[c + 1] - residue[c]))
    cut = _SMALL * top
    while True:
        first, end = 0, depth
        while end - first > 2 and abs(residue[first + 1] - residue[first]) < cut:
            first += 1
        while end - first > 2 and abs(residue[end - 1] - residue[end - 2]) < cut:
            end -= 1
        if end - first <= MOST:
            return first, end
        cut *= 1.5


@njit(cache=True, nogil=True, error_model="numpy")
def burst_damages(  # type: ignore[no-untyped-def]
    first, last, begin, duration, constant, slope, mass, jacobian, stiffness, ratio, along, factor,
    knots, lines, known, scales, closed, alone, residue, kept,
):  # fmt: skip
    """Damage of b bursts from rest, ring-down included.

    Args:
        first: of the bursts.
        last: the one after the last.
        begin: (b + 1,) where each burst's pieces begin in the next three.
        duration: (m,) s; the last of a burst endless.
        constant: (m,) N.
        slope: (m,) N/s.
        mass: (b, n, n) kg m^2.
        jacobian: (b, 3, n) m.
        stiffness: (b, n) N m/rad.
        ratio: (n,) damping ratios.
        along: (b, 3) force directions.
        factor: (b, n) stress per torque; zero without a curve.
        knots: see `curve_tables`.
        lines: likewise.
        known: likewise.
        scales: (s,) of the load.
        closed: (b, n, s) out: damage of the closed cycles, and of the residue's small ends.
        alone: (b, n, s) out: of the burst by itself, its residue as half cycles.
        residue: (b, n, MOST) out: turning points of stress.
        kept: (b, n) -1, out: how many; left so where the exact path must be taken.
    """
    n = stiffness.shape[1]
    for b in range(first, last):
        part = slice(begin[b], begin[b + 1])
        pieces = begin[b + 1] - begin[b]
        nothing, still = np.zeros(pieces, np.complex128), np.zeros(pieces)
        turns, count = swing(
            mass[b], jacobian[b], stiffness[b], ratio, along[b], np.full(n, -1.0), duration[part],
            constant[part], slope[part], nothing, still, np.empty(n), FINE,
        )  # fmt: skip
        size = turns.shape[1]
        if size == 0:
            continue
        stack, ranges, means = np.empty(size), np.empty(size), np.empty(size)
        for j in range(n):
            own = turns[j, : count[j]]
            kept[b, j] = 0
            if known[j] < 0:
                continue
            stress = factor[b, j] * stiffness[b, j]
            curve = knots[j, : known[j]], lines[j, : known[j] + 1]
            depth, cycles = push(own, stack, 0, ranges, means)
            for s in range(scales.size):
                closed[b, j, s] = cycles_damage(ranges, cycles, stress * scales[s], *curve)
            depth, cycles = finish(stack, depth, ranges, means)
            low, end = trimmed(stack, depth)
            for s in range(scales.size):
                load = stress * scales[s]
                closed[b, j, s] += cycles_damage(ranges, cycles, load, *curve)
                closed[b, j, s] += residue_damage(stack, 0, low + 1, load, *curve)
                closed[b, j, s] += residue_damage(stack, end - 1, depth, load, *curve)
                alone[b, j, s] = closed[b, j, s] + residue_damage(stack, low, end, load, *curve)
            for c in range(low, end):
                residue[b, j, c - low] = stress * stack[c]
            kept[b, j] = end - low
