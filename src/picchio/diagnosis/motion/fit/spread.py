"""How well a fit knows its values: the spread over stretches, and what drives' gains leave open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from picchio.diagnosis.motion.data.system import System
from picchio.diagnosis.motion.fit.least_squares import Fit, row_weights, stable_solve


def honest(system: System, found: Fit, gain: float) -> Fit:
    """The fit with a covariance that allows for what the model lacks.

    What a model lacks is no noise: it repeats with the motion, and all samples of a stretch say
    the same of it. So each stretch of each record is left out in turn (the jackknife), and a
    value's standard deviation is at least what that says; correlations stay. And the bodies that
    were found are weighed by the drives, whose gains are known within a tolerance.

    Args:
        system: the training equations.
        found: the fit.
        gain: relative standard deviation of each drive's torque.
    """
    if not found.coordinates:
        return found
    weight = row_weights(system, found.level)
    left, right = found.columns * weight[:, None], found.residual * weight
    prior = np.array([c.precision for c in found.coordinates])
    free = [c.lower < c.value < c.upper for c in found.coordinates]
    inside = np.flatnonzero(free)
    x = left[:, inside]
    normal = x.T @ x + np.diag(prior[inside])
    moved = []
    for number in np.unique(system.block):
        rows = system.block == number
        fewer = normal - x[rows].T @ x[rows]
        moved.append(stable_solve(fewer, x[rows].T @ right[rows]))
    power = (1.0 - 1.0 / len(moved)) * np.sum(np.square(moved), axis=0)
    inflated = np.ones(len(free))
    own = np.maximum(found.std[inside], 1e-300)
    inflated[inside] = np.maximum(1.0, np.sqrt(power) / own)
    covariance = found.covariance * np.outer(inflated, inflated)
    return replace(found, covariance=covariance + _by_gains(system, found, gain))


def _by_gains(system: System, found: Fit, gain: float) -> np.ndarray:
    """(k, k) what drives that report a little too much, each by itself, do to the values."""
    state = found.state
    columns = system.bodies(state.every, state.every[: len(state.nuisances)])
    weight = row_weights(system, found.level)
    left = found.columns * weight[:, None]
    normal = left.T @ left + np.diag([c.precision for c in found.coordinates])
    shifts = [gain * stable_solve(normal, left.T @ (c * weight)) for c in columns if np.any(c)]
    return np.array(shifts).T @ np.array(shifts) if shifts else np.zeros_like(found.covariance)
