"""Which of the poses that reach a rivet place is taken: least damage, then least utilisation."""

from __future__ import annotations

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.studies.placement_loads import Loads
from picchio.studies.placement_reach import Candidates
from picchio.studies.placement_spot import Spot
from picchio.studies.placement_work import Work

_SWEEPS = 3


def cost_tables(
    work: Work, loads: Loads, candidates: Candidates, period: float | None
) -> tuple[FloatArray, FloatArray]:
    """Damage and utilisation (k, b, c, n); infinite where there is no pose."""
    n = len(loads.robot.flexible_joints)
    shape = (len(work.group), *candidates.poses[0].shape[:2], n)
    damage, used = np.full(shape, np.inf), np.full(shape, np.inf)
    for operation in np.unique(work.operation):
        places = np.flatnonzero(work.operation == operation)
        stacked = np.stack([candidates.poses[k] for k in places])
        there = ~np.isnan(stacked).any(axis=-1)
        if not there.any():
            continue
        turned = np.stack([work.directions(candidates.moves, work.direction[k]) for k in places])
        along = np.broadcast_to(turned[:, :, None], (*there.shape, 3))[there]
        cost = loads.at(int(operation), stacked[there], along, period)
        for table, values in zip((damage, used), cost, strict=True):
            own = np.full((*there.shape, n), np.inf)
            own[there] = np.where(np.isfinite(values), values, np.inf)
            table[places] = own
    return damage, used


def choose(
    share: FloatArray,
    b: int,
    move: FloatArray,
    period: float | None,
    candidates: Candidates,
    damage: FloatArray,
    used: FloatArray,
) -> tuple[Spot | None, FloatArray]:
    """The best pose of every rivet place at one placement, and which candidates they are.

    Args:
        share: (k,) of the mix's rivets that are set at each place.
        b: which placement.
        move: (4,) of it.
        period: s, of the blows, or None.
        candidates: the poses.
        damage: (k, b, c, n), see `cost_tables`.
        used: likewise.

    Returns:
        the spot, None where a place has no pose; (k,) indices.
    """
    worst_used = used[:, b].max(axis=-1)
    spent = np.where(np.isfinite(worst_used), damage[:, b].max(axis=-1), np.inf)
    least = spent.min(axis=-1, keepdims=True) if spent.size else np.full((1, 1), np.inf)
    pick = np.where(spent <= least, worst_used, np.inf).argmin(axis=-1)
    rows = np.arange(len(pick))
    if not spent.size or not np.isfinite(spent[rows, pick]).all():
        return None, pick
    own = damage[:, b] * share[:, None, None]
    own[~np.isfinite(worst_used)] = np.inf
    total = own[rows, pick].sum(axis=0)
    if total.max() > 0.0:
        pick, total = _exchange(own, worst_used, pick, total)
    spot = Spot(
        np.array(move),
        period,
        np.array([candidates.poses[k][b, pick[k]] for k in rows]),
        float(total.max()),
        float(worst_used[rows, pick].max()),
    )
    return spot, pick


def _exchange(
    own: FloatArray, used: FloatArray, pick: FloatArray, total: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Another pose at a place wherever that spares the weakest joint, until none does.

    Joints share a robot: the pose that spares one may cost another, so the places' choices hang
    together through the sum.
    """
    for _ in range(_SWEEPS):
        changed = False
        for k in range(len(pick)):
            others = total - own[k, pick[k]]
            weakest = (others + own[k]).max(axis=-1)
            best = int(np.lexsort((used[k], weakest))[0])
            if weakest[best] < weakest[pick[k]] * (1.0 - 1e-12):
                pick[k], changed = best, True
                total = np.maximum(others + own[k, best], 0.0)
        total = own[np.arange(len(pick)), pick].sum(axis=0)
        if not changed:
            break
    return pick, total
