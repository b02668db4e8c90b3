"""Causes must hold on every record that was not fitted to, where there are two or more."""

from __future__ import annotations

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.diagnosis.motion.criteria.score import contribution
from picchio.diagnosis.motion.data.system import System
from picchio.diagnosis.motion.fit.least_squares import (
    Fit,
    difference,
    fit,
    row_weights,
    stable_solve,
)
from picchio.model.effects.effect import Effect

_LITTLE = 0.05


def validate(
    train: System, held_out: System, current: Fit
) -> tuple[Fit, list[tuple[Effect, dict[str, float]]]]:
    """The fit without causes that lose on a record held out, and those causes.

    With one record held out nothing is tested here: it stays the judge that it is.

    Args:
        train: the equations fitted to.
        held_out: those of the records held out.
        current: the fit.
    """
    dropped: list[tuple[Effect, dict[str, float]]] = []
    if len(held_out.logs) < 2:
        return current, dropped
    while current.state.effects:
        seen, equations = held_out_equations(held_out, current), normal_equations(train, current)
        gains = [gain_by_record(held_out, current, i, seen, equations)
                 for i in range(len(current.state.effects))]  # fmt: skip
        failing = [
            i for i, found in enumerate(gains)
            if found and _fails(found, current.state.effects[i].periodic)
        ]  # fmt: skip
        if not failing:
            break
        # Ripples hardly touch each other and go together; others one by one, the worst first.
        gone = [i for i in failing if current.state.effects[i].periodic]
        others = [i for i in failing if i not in gone]
        if others:
            gone.append(min(others, key=lambda i: min(gains[i].values())))
        state = current.state
        for i in sorted(gone, reverse=True):
            dropped.append((state.effects[i], gains[i]))
            state = state.without(i)
        current = fit(train, state, rounds=3)
    return current, dropped


def _fails(gains: dict[str, float], ripple: bool) -> bool:
    """A cause must gain on every record; a narrow line may lose a little on one of them."""
    worst, mean = min(gains.values()), sum(gains.values()) / len(gains)
    return mean <= 0.0 or worst <= (-_LITTLE if ripple else 0.0)


def normal_equations(train: System, current: Fit) -> tuple[FloatArray, FloatArray]:
    """(k, k) and (k,): of all training rows, weighted, for the fit's coordinates."""
    weight = row_weights(train, current.level)
    left = current.columns * weight[:, None]
    return left.T @ left, left.T @ (current.residual * weight)


def gain_by_record(
    held_out: System, current: Fit, index: int, seen: tuple[FloatArray, FloatArray],
    equations: tuple[FloatArray, FloatArray],
) -> dict[str, float]:  # fmt: skip
    """File -> part of the power in its equations that an effect takes away, linearised.

    Without the effect everything else is fitted anew to the training records.

    Args:
        held_out: the equations of the records held out.
        current: the fit to the training records.
        index: which effect.
        seen: of `held_out_equations`.
        equations: of `normal_equations`.
    """
    own, part = contribution(current, index)
    if not own:
        return {}
    rest = [i for i in range(len(current.coordinates)) if i not in own]
    normal, right = equations
    prior = np.array([current.coordinates[i].precision for i in rest])
    target = right[rest] + normal[np.ix_(rest, own)] @ part
    step = stable_solve(normal[np.ix_(rest, rest)] + np.diag(prior), target)
    change = np.zeros(len(current.coordinates))
    change[own], change[rest] = part, -step
    columns, residual = seen
    found: dict[str, list[float]] = {}
    scale = row_weights(held_out, {g: current.level.get(g, 1.0) for g in held_out.groups})
    for s in held_out.segments:
        if not np.any(columns[s.rows][:, own]):
            continue
        without = residual[s.rows] + columns[s.rows] @ change
        sums = found.setdefault(held_out.logs[s.record].file, [0.0, 0.0])
        sums[0] += float(np.sum((without * scale[s.rows]) ** 2))
        sums[1] += float(np.sum((residual[s.rows] * scale[s.rows]) ** 2))
    return {file: (a - b) / max(a, 1e-300) for file, (a, b) in found.items()}


def held_out_equations(system: System, current: Fit) -> tuple[FloatArray, FloatArray]:
    """Derivatives (rows, k) by the fit's coordinates, and the residual, on records held out."""
    predicted = system.predict(current.state.every, current.state.scales)
    columns = [difference(system, current.state, c, predicted) for c in current.coordinates]
    matrix = np.column_stack(columns) if columns else np.zeros((system.size, 0))
    return matrix, system.measured - predicted
