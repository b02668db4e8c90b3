"""Forward nonlinear least squares: Levenberg-Marquardt on whitened residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.diagnosis.percussion.problem import MeasuredRecord, Problem
from picchio.diagnosis.percussion.unknowns import Hypothesis, Unknown

# Windows that grow, s: a long one at once lets the fit skip cycles.
WINDOWS = (0.06, 0.16, 0.4, None)
_CONVERGED = 1e-5
_INSIDE = 1e-9
_LEAST_STEP = 1e-7
_HOPELESS = 1.5


@dataclass(frozen=True, eq=False)
class Fit:
    """A hypothesis fitted to some records up to some time.

    Attributes:
        hypothesis: with the values found.
        residuals: whitened, (channels, m) a record.
        jacobians: (channels x m, unknowns) a record; None where it was not asked for.
        cost: sum of squares of the residuals and of the priors.
        records: fitted.
        end: s; None for all.
    """

    hypothesis: Hypothesis
    residuals: list[FloatArray]
    jacobians: list[FloatArray] | None
    cost: float
    records: tuple[MeasuredRecord, ...]
    end: float | None

    @property
    def chi_square(self) -> float:
        """Sum of squares of the residuals."""
        return float(sum((r * r).sum() for r in self.residuals))

    @property
    def samples(self) -> int:
        """How many residuals."""
        return int(sum(r.size for r in self.residuals))

    def normal_matrix(self) -> FloatArray:
        """(unknowns, unknowns), priors included."""
        if self.jacobians is None:
            raise InputError("this fit has no Jacobian")
        total = sum(j.T @ j for j in self.jacobians)
        matrix: FloatArray = np.asarray(total) + np.diag(prior_weights(self.hypothesis) ** 2)
        return matrix

    def covariance(self) -> FloatArray:
        """(unknowns, unknowns) of the transformed unknowns."""
        matrix = self.normal_matrix()
        scale = np.sqrt(np.maximum(matrix.diagonal(), 1e-300))
        return np.asarray(np.linalg.pinv(matrix / np.outer(scale, scale)) / np.outer(scale, scale))


def prior_weights(hypothesis: Hypothesis) -> FloatArray:
    """(unknowns,) 1 / standard deviation of what is known beforehand, 0 where nothing is."""
    return np.array([1.0 / u.prior[1] if u.prior else 0.0 for u in hypothesis.unknowns()])


def prior_cost(hypothesis: Hypothesis) -> float:
    """Sum of squares of the priors."""
    u, w = hypothesis.vector(), prior_weights(hypothesis)
    means = np.array([k.prior[0] if k.prior else 0.0 for k in hypothesis.unknowns()])
    return float(((w * (u - means)) ** 2).sum())


def jacobian(
    problem: Problem,
    hypothesis: Hypothesis,
    records: Sequence[MeasuredRecord],
    end: float | None,
    at: list[FloatArray],
    steps: FloatArray | None = None,
) -> list[FloatArray]:
    """D residual / d unknowns of every record by differences, (channels x m, unknowns).

    Args:
        problem: data and noise.
        hypothesis: where.
        records: which.
        end: s.
        at: the residuals there.
        steps: (unknowns,) of the differences; the unknowns' own where None.
    """
    vector, unknowns = hypothesis.vector(), hypothesis.unknowns()
    columns: list[list[FloatArray]] = [[] for _ in records]
    for k, unknown in enumerate(unknowns):
        step = unknown.step if steps is None else float(steps[k])
        if vector[k] + step > unknown.upper:
            step = -step
        moved = vector.copy()
        moved[k] += step
        there = problem.residuals(hypothesis.at(moved).effects, records, end)
        for i, (a, b) in enumerate(zip(there, at, strict=True)):
            columns[i].append(((a - b) / step).ravel())
    return [
        np.stack(c, axis=1) if c else np.zeros((a.size, 0))
        for c, a in zip(columns, at, strict=True)
    ]


def fit(
    problem: Problem,
    hypothesis: Hypothesis,
    records: Sequence[MeasuredRecord] | None = None,
    end: float | None = None,
    *,
    iterations: int = 8,
    with_jacobian: bool = False,
    rival: float = np.inf,
) -> Fit:
    """Fit a hypothesis's unknowns.

    Args:
        problem: data and noise.
        hypothesis: with start values.
        records: all where None.
        end: s, fit the records up to here.
        iterations: at most.
        with_jacobian: compute it at the end.
        rival: cost of another hypothesis: give up on one that stays far above it.
    """
    chosen = tuple(problem.records if records is None else records)
    here = hypothesis
    residuals = problem.residuals(here.effects, chosen, end)
    cost = _square(residuals) + prior_cost(here)
    damping = 1e-3
    fresh: list[FloatArray] | None = None
    steps: FloatArray | None = None
    for turn in range(iterations):
        if turn > 1 and cost > _HOPELESS * rival:
            break
        unknowns = here.unknowns()
        if not unknowns:
            break
        fresh = jacobian(problem, here, chosen, end, residuals, steps)
        steps = _fine_steps(fresh, unknowns)
        weights = prior_weights(here)
        vector = here.vector()
        means = np.array([u.prior[0] if u.prior else 0.0 for u in unknowns])
        normal = sum(j.T @ j for j in fresh) + np.diag(weights**2)
        gradient = sum(j.T @ r.ravel() for j, r in zip(fresh, residuals, strict=True))
        gradient = gradient + weights**2 * (vector - means)
        if not np.isfinite(normal).all():
            break
        scale = np.sqrt(np.maximum(np.diag(normal), 1e-12 * np.diag(normal).max() + 1e-300))
        lower = np.array([u.lower for u in unknowns])
        upper = np.array([u.upper for u in unknowns])
        improved = False
        for _ in range(7):
            step = _bounded_step(normal, gradient, scale, damping, vector, lower, upper)
            trial = here.at(vector + step)
            try:
                there = problem.residuals(trial.effects, chosen, end)
                value = _square(there) + prior_cost(trial)
            except InputError:  # left the models that exist: springs overturned, no mass
                value = np.inf
            if value < cost:
                improved = True
                break
            damping *= 6.0
        if not improved:
            break
        gained = cost - value
        here, residuals, cost, fresh = trial, there, value, None
        damping = max(damping / 8.0, 1e-9)
        if gained < _CONVERGED * cost + 1e-3:
            break
    if with_jacobian and fresh is None:
        fresh = jacobian(problem, here, chosen, end, residuals, steps)
    return Fit(here, residuals, fresh if with_jacobian else None, cost, chosen, end)


def _fine_steps(parts: Sequence[FloatArray], unknowns: Sequence[Unknown]) -> FloatArray:
    """Steps that change the residuals by about two standard deviations all in all.

    The time of a blow's edge is known to a microsecond: a step of a thousandth would carry late
    edges past samples, and its difference quotient would say nothing of the slope.
    """
    norms = np.sqrt(sum((part**2).sum(axis=0) for part in parts))
    own = np.array([u.step for u in unknowns])
    return np.asarray(np.clip(2.0 / np.maximum(norms, 1e-12), _LEAST_STEP, own))


def _square(residuals: Sequence[FloatArray]) -> float:
    total = float(sum((r * r).sum() for r in residuals))
    return total if np.isfinite(total) else np.inf


def _bounded_step(
    normal: FloatArray,
    gradient: FloatArray,
    scale: FloatArray,
    damping: float,
    vector: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
) -> FloatArray:
    """The damped step that stays within the bounds: what would leave them is held, in turn."""
    size = vector.size
    free = np.ones(size, dtype=bool)
    step = np.zeros(size)
    for _ in range(size + 1):
        index = np.flatnonzero(free)
        if not index.size:
            break
        held = np.flatnonzero(~free)
        right = -gradient[index] - normal[np.ix_(index, held)] @ step[held]
        block = normal[np.ix_(index, index)] / np.outer(scale[index], scale[index])
        block = block + damping * np.eye(index.size)
        step[index] = np.linalg.lstsq(block, right / scale[index], rcond=None)[0] / scale[index]
        new = vector + step
        out = free & ((new < lower - _INSIDE) | (new > upper + _INSIDE))
        if not out.any():
            break
        step[out] = np.clip(new[out], lower[out], upper[out]) - vector[out]
        free &= ~out
    return step


def fit_growing(
    problem: Problem,
    hypothesis: Hypothesis,
    records: Sequence[MeasuredRecord] | None = None,
    *,
    windows: Sequence[float | None] = WINDOWS,
    iterations: int = 6,
    with_jacobian: bool = False,
) -> Fit:
    """Fit up to one time after the other."""
    found: Fit | None = None
    for i, end in enumerate(windows):
        last = i == len(windows) - 1
        start = found.hypothesis if found else hypothesis
        found = fit(
            problem,
            start,
            records,
            end,
            iterations=iterations if last else 3,
            with_jacobian=with_jacobian and last,
        )
    assert found is not None
    return found
