"""Weighted least squares of all equations: Gauss-Newton, priors, bounds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.diagnosis.active_set import bounded_solution
from picchio.diagnosis.motion.data.system import BLOCKS, Group, System
from picchio.diagnosis.motion.fit.state import Coordinate, State
from picchio.prediction.motion.readings import Around

_ROUNDS = 6
_TINY = 1e-300
_ROUNDING = 1e-10
_PIVOT = 1e-3
_ROUNDED = 1e-12


@dataclass(frozen=True, eq=False)
class Fit:
    """A state fitted to a system.

    Attributes:
        state: with the values found.
        residual: (rows,) measured less predicted.
        columns: (rows, k) derivatives by the coordinates.
        coordinates: the k that were varied.
        covariance: (k, k), for autocorrelated residuals.
        level: group -> RMS of its residual.
        correlation: group -> samples that tell as much as one independent sample does.
    """

    state: State
    residual: FloatArray
    columns: FloatArray
    coordinates: list[Coordinate]
    covariance: FloatArray
    level: dict[Group, float]
    correlation: dict[Group, float]

    @property
    def std(self) -> FloatArray:
        """(k,) standard deviations."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))


def fit(system: System, state: State, *, rounds: int = _ROUNDS) -> Fit:
    """The state's values that leave least.

    Every group is weighted by the RMS of what it leaves.

    Args:
        system: the equations.
        state: where to start.
        rounds: of Gauss-Newton, at most; linear problems need one.
    """
    best: tuple[float, State] | None = None
    state = state.within(system)
    for _ in range(rounds):
        predicted = system.predict(state.every, state.scales)
        residual = system.measured - predicted
        level = levels(system, residual)
        cost = sum(len_of(system, g) * np.log(max(s, _TINY)) for g, s in level.items())
        if best is not None and cost > best[0] - 1e-6 * abs(best[0]) - 1e-9:
            if cost > best[0]:
                state = best[1]
            break
        best = (cost, state)
        coordinates, columns = jacobian(system, state, predicted, state.coordinates(system))
        if not coordinates:
            break
        weight = row_weights(system, level)
        step = solve(columns * weight[:, None], residual * weight, coordinates)
        for c, change in zip(coordinates, step, strict=True):
            state = state.moved(c, float(np.clip(c.value + change, c.lower, c.upper)))
        state = state.within(system)
    return finish(system, state)


def finish(system: System, state: State) -> Fit:
    """Residual, derivatives and standard deviations at a state."""
    predicted = system.predict(state.every, state.scales)
    residual = system.measured - predicted
    coordinates, columns = jacobian(system, state, predicted, state.coordinates(system))
    level = levels(system, residual)
    correlation = {group: correlation_length(system, residual, group) for group in system.groups}
    spread = {g: max(each, _TINY) * np.sqrt(correlation[g]) for g, each in level.items()}
    weighted = columns * row_weights(system, spread)[:, None]
    normal = weighted.T @ weighted + np.diag([c.precision for c in coordinates])
    scale = np.sqrt(np.maximum(np.diag(normal), _TINY))
    size = np.outer(scale, scale)
    covariance = np.linalg.pinv(normal / size, hermitian=True) / size
    return Fit(state, residual, columns, coordinates, covariance, level, correlation)


def jacobian(
    system: System,
    state: State,
    predicted: FloatArray,
    coordinates: list[Coordinate],
    around: Sequence[Around] | None = None,
) -> tuple[list[Coordinate], FloatArray]:
    """(rows, k) derivatives; coordinates that change nothing are left out.

    Args:
        system: the equations.
        state: where.
        predicted: (rows,) there.
        coordinates: the k of them.
        around: of `System.around` there, where it is known.
    """
    kept: list[Coordinate] = []
    columns: list[FloatArray] = []
    column: FloatArray | None
    around = system.around(state.every) if around is None else around
    for c in coordinates:
        if c.index < 0:
            column = system.by_scale(around, c.name)
        else:
            step = _inward(c)
            effect = state.moved(c, c.value + step).every[c.index]
            column = system.by_parameter(around, state.every[c.index], effect, c.name, step)
        if column is None:
            column = difference(system, state, c, predicted)
        if np.any(column):
            kept.append(c)
            columns.append(column)
    matrix = np.column_stack(columns) if columns else np.zeros((system.size, 0))
    return kept, matrix


def _inward(c: Coordinate) -> float:
    """The step for a difference, towards where there is room."""
    return -c.step if c.value + c.step > c.upper else c.step


def difference(system: System, state: State, c: Coordinate, predicted: FloatArray) -> FloatArray:
    """(rows,) derivative of the prediction by one coordinate, by a difference.

    Args:
        system: the equations.
        state: where.
        c: the coordinate.
        predicted: (rows,) there.
    """
    step = _inward(c)
    other = state.moved(c, c.value + step)
    only = other.every[c.index] if c.index >= 0 else None
    changed = system.predict(other.every, other.scales, only, predicted)
    return clean(system, changed - predicted) / step


def clean(system: System, change: FloatArray) -> FloatArray:
    """A change of the prediction, without what is rounding in a segment."""
    found = change.copy()
    for s in system.segments:
        size = float(np.abs(s.measured).max())
        if float(np.abs(found[s.rows]).max()) < _ROUNDING * size:
            found[s.rows] = 0.0
    return found


def solve(columns: FloatArray, residual: FloatArray, coordinates: list[Coordinate]) -> FloatArray:
    """(k,) the step that leaves least within the bounds (active set)."""
    normal = columns.T @ columns + np.diag([c.precision for c in coordinates])
    right = columns.T @ residual + np.array([c.pull for c in coordinates])
    low = np.array([c.lower - c.value for c in coordinates])
    high = np.array([c.upper - c.value for c in coordinates])
    return bounded_solution(
        normal, right, low, high, lambda block, part, _: stable_solve(block, part), _ROUNDED
    )


def stable_solve(normal: FloatArray, right: FloatArray) -> FloatArray:
    """Solve normal equations of columns in any units; what can't be told apart is shared."""
    scale = np.sqrt(np.maximum(np.diag(normal), _TINY))
    scaled = normal / np.outer(scale, scale)
    found: FloatArray
    try:
        # Singular values cost ten times as much: they are for columns that are nearly one.
        if np.linalg.cholesky(scaled).diagonal().min(initial=1.0) > _PIVOT:
            found = np.linalg.solve(scaled, right / scale) / scale
            return found
    except np.linalg.LinAlgError:
        pass
    found = np.linalg.lstsq(scaled, right / scale, rcond=1e-11)[0] / scale
    return found


def stable_solves(normal: FloatArray, right: FloatArray) -> FloatArray:
    """(n, k) `stable_solve` of n systems, (n, k, k) and (n, k)."""
    scale = np.sqrt(np.maximum(np.diagonal(normal, axis1=1, axis2=2), _TINY))
    scaled = normal / (scale[:, :, None] * scale[:, None, :])
    try:
        pivots = np.diagonal(np.linalg.cholesky(scaled), axis1=1, axis2=2)
        if pivots.min(initial=1.0) > _PIVOT:
            solved: FloatArray = np.linalg.solve(scaled, (right / scale)[:, :, None])[:, :, 0]
            return solved / scale
    except np.linalg.LinAlgError:
        pass
    return np.array([stable_solve(a, b) for a, b in zip(normal, right, strict=True)])


def levels(system: System, residual: FloatArray) -> dict[Group, float]:
    """Group -> RMS."""
    power: dict[Group, list[float]] = {}
    for s in system.segments:
        part = residual[s.rows]
        sums = power.setdefault(s.group, [0.0, 0.0])
        sums[0] += float(part @ part)
        sums[1] += part.size
    return {g: float(np.sqrt(total / count)) for g, (total, count) in power.items()}


def row_weights(system: System, level: dict[Group, float]) -> FloatArray:
    """(rows,) one over the group's level."""
    weight = np.empty(system.size)
    for s in system.segments:
        weight[s.rows] = 1.0 / max(level[s.group], _TINY)
    return weight


def len_of(system: System, group: Group) -> int:
    """Rows of a group."""
    return sum(s.samples.size for s in system.of(group))


def correlation_length(system: System, residual: FloatArray, group: Group) -> float:
    """Samples for each independent one: 1 + 2 sum of the autocorrelation until it vanishes.

    A stretch of a record is never taken for less than four independent samples.
    """
    total, lags, stretches = np.zeros(0), 0, 0
    for s in system.of(group):
        part = residual[s.rows]
        stretches += BLOCKS
        if part.size < 8:
            continue
        spectrum = np.abs(np.fft.rfft(part, 2 * part.size)) ** 2
        auto = np.fft.irfft(spectrum)[: part.size // 2]
        lags = min(lags, auto.size) if lags else auto.size
        total = auto[:lags] + (total[:lags] if total.size else 0.0)
    if total.size == 0 or total[0] <= 0.0:
        return 1.0
    rho = total / total[0]
    below = np.flatnonzero(rho <= 0.0)
    end = int(below[0]) if below.size else rho.size
    longest = len_of(system, group) / (4.0 * stretches)
    return float(max(1.0, min(1.0 + 2.0 * rho[1:end].sum(), longest)))
