"""Whether an effect shows: what it changes in the data that no nuisance can imitate."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from .campaign import noise_levels
from .world import TOLERANCE, World, clean


def detectability(world, groups, snr_db=40.0):
    """How far the causes of a world stand out of the noise.

    The effect's change of the data, less the best change that stiffness, damping and force within
    tolerance make (by finite differences in this same simulator), against white noise.

    Args:
        world: with its causes.
        groups: channel groups, as `campaign.groups_of` gives them.
        snr_db: of each group.

    Returns:
        {"bic_gain", "chi_square", "raw_chi_square", "parameters", "samples"}; detectable is a
        `bic_gain` above 10.
    """
    before, moved, prior = _healthy(
        world.plan,
        world.nuisances,
        tuple(groups),
        world.seed,
        world.bandwidth,
        world.modal,
        world.step,
    )
    after = clean(world, groups)
    times = world.plan.times()
    keep = times >= 0.0
    levels = noise_levels(after, times, snr_db)

    def stack(data):
        return np.concatenate(
            [(record[g][keep] / levels[g]).ravel() for record in data for g in groups]
        )

    base = stack(before)
    change = stack(after) - base
    rows = [stack(data) - base for data in moved]
    # columns in units of one standard deviation of the tolerance, each held by its prior
    columns = np.array([row / _STEP * sigma for row, sigma in zip(rows, prior, strict=True)])
    normal = columns @ columns.T + np.eye(len(columns))
    best = np.linalg.solve(normal, columns @ change)
    left = change - columns.T @ best
    chi_square = float(left @ left + best @ best)
    count = sum(_count(c[2]) for c in world.causes)
    return {
        "bic_gain": chi_square - count * float(np.log(base.size)),
        "chi_square": chi_square,
        "raw_chi_square": float(change @ change),
        "parameters": count,
        "samples": base.size,
    }


_STEP = 1e-3


@lru_cache(maxsize=2)
def _healthy(plan, nuisances, groups, seed, bandwidth, modal, step):
    """Data without causes, the same with each nuisance moved, and the nuisances' tolerances."""
    world = World(plan, nuisances, (), seed, bandwidth, modal, step)
    steps = list(_steps(nuisances))
    moved = [clean(replace(world, nuisances=near), groups) for near, _ in steps]
    return clean(world, groups), moved, [sigma for _, sigma in steps]


def _steps(nuisances):
    """Each nuisance moved by a thousandth of the nominal value, and its standard deviation."""
    for j in range(nuisances.stiffness.size):
        stiffness = nuisances.stiffness.copy()
        stiffness[j] += _STEP
        yield replace(nuisances, stiffness=stiffness), TOLERANCE["stiffness"]
    ratio = nuisances.damping_ratio + _STEP
    yield replace(nuisances, damping_ratio=ratio), TOLERANCE["damping_ratio"]
    yield replace(nuisances, force=nuisances.force + _STEP), TOLERANCE["force"]


def _count(parameters):
    return max(1, sum(isinstance(v, (int, float)) for v in parameters.values()))
