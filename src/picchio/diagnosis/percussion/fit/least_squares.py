"""Nonlinear least squares: Levenberg-Marquardt on whitened residuals, over growing windows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.diagnosis.active_set import bounded_solution
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.data.record import MeasuredRecord
from picchio.diagnosis.percussion.fit.slopes import borrowed, fine_steps, jacobian, updated
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis

# Windows that grow, s: a long one at once lets the fit skip cycles.
WINDOWS = (0.06, 0.16, 0.4, None)
_CONVERGED = 1e-5
_INSIDE = 1e-9
# Times a rival's cost: what is still above that after two rounds is given up.
HOPELESS = 1.5
# A step that gains less than this share of what was expected asks for a new Jacobian.
_TRUSTED = 0.25


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
        """(unknowns, unknowns), priors included.

        Raises:
            InputError: the fit was made without its Jacobian.
        """
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


# A trial far off may diverge: what is no number then ends it.
@np.errstate(over="ignore", invalid="ignore")
def fit(
    problem: Problem,
    hypothesis: Hypothesis,
    records: Sequence[MeasuredRecord] | None = None,
    end: float | None = None,
    *,
    iterations: int = 8,
    with_jacobian: bool = False,
    rival: float = np.inf,
    near: Fit | None = None,
) -> Fit:
    """Fit a hypothesis's unknowns.

    The Jacobian is carried from step to step by Broyden's update (Mathematics of Computation 19
    (1965) 577, doi:10.1090/S0025-5718-1965-0198670-6), and made anew where it has led astray.

    Args:
        problem: data and noise.
        hypothesis: with start values.
        records: all where None.
        end: s, fit the records up to here.
        iterations: at most.
        with_jacobian: compute it at the end.
        rival: cost of another hypothesis: give up on one that stays far above it.
        near: a fit to the same records, at least as long, whose unknowns come first among these:
            its Jacobian is good enough to rank candidates by.
    """
    chosen = tuple(problem.records if records is None else records)
    here = hypothesis
    residuals = problem.residuals(here.effects, chosen, end)
    cost = _square(residuals) + prior_cost(here)
    damping = 1e-3
    slopes: list[FloatArray] | None = None
    steps: FloatArray | None = None
    fresh, refined, turn = False, False, 0
    while turn < iterations and not (turn > 1 and cost > HOPELESS * rival):
        unknowns = here.unknowns()
        if not unknowns:
            break
        if slopes is None:
            first = None
            if turn == 0 and near is not None and near.jacobians is not None:
                first = borrowed(here, residuals, near.hypothesis, near.jacobians, near.residuals)
            slopes = jacobian(problem, here, chosen, end, residuals, steps, first)
            steps, fresh = fine_steps(slopes, unknowns), first is None
        weights, vector = prior_weights(here), here.vector()
        means = np.array([u.prior[0] if u.prior else 0.0 for u in unknowns])
        normal = sum(j.T @ j for j in slopes) + np.diag(weights**2)
        gradient = sum(j.T @ r.ravel() for j, r in zip(slopes, residuals, strict=True))
        gradient = gradient + weights**2 * (vector - means)
        if not np.isfinite(normal).all():
            break
        scale = np.sqrt(np.maximum(np.diag(normal), 1e-12 * np.diag(normal).max() + 1e-300))
        lower = np.array([u.lower for u in unknowns])
        upper = np.array([u.upper for u in unknowns])
        improved = False
        for _ in range(7 if fresh else 2):
            step = bounded_step(normal, gradient, scale, damping, vector, lower, upper)
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
            if fresh and (refined or not is_nonsmooth(here)):
                break
            # Carried too far; or differences were too coarse for a motion that a kink makes rough.
            refined = fresh
            slopes, damping = None, 1e-3
            if near is not None:
                turn += 1
            continue
        turn += 1
        refined = False
        gained = cost - value
        moved = trial.vector() - vector
        expected = -float(2.0 * gradient @ moved + moved @ normal @ moved)
        slopes = updated(slopes, residuals, there, moved, scale)
        here, residuals, cost = trial, there, value
        damping = max(damping / 8.0, 1e-9)
        small = gained < _CONVERGED * cost + 1e-3
        if small and (fresh or near is not None):
            fresh = False
            break
        fresh = False
        if small or gained < _TRUSTED * expected:
            slopes = None
    if with_jacobian and not (fresh and slopes is not None):
        slopes = jacobian(problem, here, chosen, end, residuals, steps)
    return Fit(here, residuals, slopes if with_jacobian else None, cost, chosen, end)


def is_nonsmooth(hypothesis: Hypothesis) -> bool:
    """Whether a small change of an unknown may change the motion a lot."""
    return any(effect.where == "nonlinear" for effect in hypothesis.effects)


def _square(residuals: Sequence[FloatArray]) -> float:
    with np.errstate(over="ignore", invalid="ignore"):  # of a trial far off
        total = float(sum((r * r).sum() for r in residuals))
    return total if np.isfinite(total) else np.inf


def bounded_step(
    normal: FloatArray,
    gradient: FloatArray,
    scale: FloatArray,
    damping: float,
    vector: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
) -> FloatArray:
    """The damped step that stays within the bounds."""

    def solve(block: FloatArray, right: FloatArray, index: NDArray[np.intp]) -> FloatArray:
        size = scale[index]
        damped = block / np.outer(size, size) + damping * np.eye(index.size)
        return np.asarray(np.linalg.lstsq(damped, right / size, rcond=None)[0] / size)

    return bounded_solution(normal, -gradient, lower - vector, upper - vector, solve, _INSIDE)


def fit_growing(
    problem: Problem,
    hypothesis: Hypothesis,
    records: Sequence[MeasuredRecord] | None = None,
    *,
    windows: Sequence[float | None] = WINDOWS,
    iterations: int = 6,
    with_jacobian: bool = False,
    near: Fit | None = None,
) -> Fit:
    """Fit up to one time after the other.

    Args:
        problem: the data.
        hypothesis: where to start.
        records: to fit; all where None.
        windows: s, ends of the growing stretch that is fitted; None for the whole record.
        iterations: of the last window; the others take 3.
        with_jacobian: compute the Jacobian at the end.
        near: a fit nearby, whose slopes may be used again.

    Returns:
        the fit to the last window.
    """
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
            near=near,
        )
    assert found is not None
    return found
