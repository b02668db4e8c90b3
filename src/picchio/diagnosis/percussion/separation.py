"""By how much a record would tell rivals apart, whatever else is refitted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.diagnosis.percussion.fit import Fit
from picchio.diagnosis.percussion.problem import Problem
from picchio.diagnosis.percussion.unknowns import Hypothesis
from picchio.prediction.percussion import PercussionSetup

_SENSORS = ("deflection", "accelerometer")
# Relative noise of a sensor that the campaign does not have.
_NEW_SENSOR = 0.01


def separation(
    problem: Problem, setup: PercussionSetup, best: Fit, rivals: Sequence[Hypothesis]
) -> dict[str, FloatArray]:
    """Sensor -> by how much chi-square would tell each rival, when the best model is refitted."""
    here = setup.predict(problem.model.with_effects(best.hypothesis.effects))
    there = [setup.predict(problem.model.with_effects(h.effects)) for h in rivals]
    moves, covariance = _moves(problem, setup, best, here)
    own = [c.name for c in setup.channels if c.group in problem.groups]
    found = {}
    for sensor in _SENSORS:
        rows = own + [n for n in here if n.startswith(f"{sensor}.") and n not in own]
        noise = {name: _noise(problem, name, here) for name in rows}
        slopes = np.concatenate([moves[n] / noise[n] for n in rows]) if moves else None
        told = []
        for other in there:
            left = np.concatenate([(other[n] - here[n]) / noise[n] for n in rows])
            told.append(_left(left, slopes, covariance))
        found[sensor] = np.array(told)
    return found


def _noise(problem: Problem, name: str, here: dict[str, FloatArray]) -> float:
    known = problem.noise.get(name)
    if known is not None and known.std > 0.0:
        return known.std
    return _NEW_SENSOR * max(float(np.sqrt(np.mean(here[name] ** 2))), 1e-300)


def _moves(
    problem: Problem, setup: PercussionSetup, best: Fit, here: dict[str, FloatArray]
) -> tuple[dict[str, FloatArray], FloatArray]:
    """Channel -> (samples, unknowns) of the best model, and the unknowns' covariance."""
    if best.jacobians is None:
        return {}, np.zeros((0, 0))
    covariance = best.covariance()
    vector = best.hypothesis.vector()
    steps = np.clip(np.sqrt(np.maximum(covariance.diagonal(), 0.0)), 1e-6, 1e-3)
    columns: dict[str, list[FloatArray]] = {name: [] for name in here}
    for k, step in enumerate(steps):
        moved = vector.copy()
        moved[k] += step
        effects = best.hypothesis.at(moved).effects
        there = setup.predict(problem.model.with_effects(effects))
        for name in here:
            columns[name].append((there[name] - here[name]) / step)
    return {name: np.stack(c, axis=1) for name, c in columns.items()}, covariance


def _left(left: FloatArray, slopes: FloatArray | None, covariance: FloatArray) -> float:
    """Chi-square of a difference after what the unknowns, within what is known, can do."""
    total = float(left @ left)
    if slopes is None:
        return total
    scaled = slopes @ _root(covariance)
    right = scaled.T @ left
    return total - float(right @ np.linalg.solve(np.eye(right.size) + scaled.T @ scaled, right))


def _root(covariance: FloatArray) -> FloatArray:
    """(n, n) whose product with its transpose is the covariance, singular or not."""
    scale = np.sqrt(np.maximum(covariance.diagonal(), 0.0))
    outer = np.outer(scale, scale)
    related = np.where(outer > 0.0, covariance / np.where(outer > 0.0, outer, 1.0), 0.0)
    values, vectors = np.linalg.eigh(0.5 * (related + related.T))
    return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))
