"""Whether an effect shows: what it changes in the data that no nuisance can imitate."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import lsq_linear

from .campaign import noise_levels
from .world import TOLERANCE, World, clean


def detectability(world, groups, snr_db=40.0):
    """How far the causes of a world stand out of the noise.

    The effect's change of the data, less the best change that stiffness, damping and force within
    tolerance make (fitted in this same simulator by Gauss and Newton's steps, each run again: what
    a linear change leaves of a large shift is no evidence), against white noise.

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
        world.errors,
    )
    after = clean(world, groups)
    times = world.plan.times()
    keep = times >= 0.0
    levels = noise_levels(after, times, snr_db)

    def stack(data):
        return np.concatenate(
            [(record[g][keep] / levels[g]).ravel() for record in data for g in groups]
        )

    base, seen = stack(before), stack(after)
    change = seen - base
    # columns in units of one standard deviation of the tolerance, each held by its prior
    columns = np.array(
        [(stack(data) - base) / _STEP * sigma for data, sigma in zip(moved, prior, strict=True)]
    )
    normal = columns @ columns.T + np.eye(len(columns))
    healthy = replace(world, causes=())
    best, left = np.zeros(len(columns)), change
    drawn = (np.array(_flat(world.nuisances)) - 1.0) / np.array(prior)
    lowest, highest = -_TOLERATED - drawn, _TOLERATED - drawn
    chi_square = float(left @ left)
    for _ in range(_STEPS):
        step = _bounded(normal, columns @ left - best, lowest - best, highest - best)
        there = replace(healthy, nuisances=_moved(world.nuisances, best + step, prior))
        trial = seen - stack(clean(there, groups))
        cost = float(trial @ trial + (best + step) @ (best + step))
        if cost >= chi_square:
            break
        settled = chi_square - cost < _SETTLED
        best, left, chi_square = best + step, trial, cost
        if settled:
            break
    count = sum(_count(c[2]) for c in world.causes)
    return {
        "bic_gain": chi_square - count * float(np.log(base.size)),
        "chi_square": chi_square,
        "raw_chi_square": float(change @ change),
        "parameters": count,
        "samples": base.size,
    }


_STEP = 1e-3
# Gauss-Newton steps at most, and the fall of chi-square that is worth another.
_STEPS = 8
_SETTLED = 0.3


# Standard deviations of the tolerance that a nuisance may be off.
_TOLERATED = 2.0


def _bounded(normal, right, lowest, highest):
    """The least-squares step within bounds, of its normal equations."""
    root = cholesky(normal)
    aim = solve_triangular(root, right, trans="T")
    return lsq_linear(root, aim, bounds=(lowest - 1e-9, highest + 1e-9)).x


def _flat(nuisances):
    return (*nuisances.stiffness, nuisances.damping_ratio, nuisances.force)


def _moved(nuisances, by, sigma):
    """Nuisances moved by so many standard deviations of their tolerances."""
    n = nuisances.stiffness.size
    shift = np.asarray(by) * np.asarray(sigma)
    return replace(
        nuisances,
        stiffness=nuisances.stiffness + shift[:n],
        damping_ratio=float(nuisances.damping_ratio + shift[n]),
        force=float(nuisances.force + shift[n + 1]),
    )


@lru_cache(maxsize=2)
def _healthy(plan, nuisances, groups, seed, bandwidth, modal, step, errors):
    """Data without causes, the same with each nuisance moved, and the nuisances' tolerances."""
    world = World(plan, nuisances, (), seed, bandwidth, modal, step, errors)
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
