"""Nonlinear least squares: Levenberg-Marquardt on whitened residuals, over growing windows."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.diagnosis.active_set import bounded_solution
from picchio.diagnosis.attempt import attempt
from picchio.diagnosis.percussion.data.problem import MeasuredRecord, Problem
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis, Unknown
from picchio.prediction.percussion import BY_MODES

# Windows that grow, s: a long one at once lets the fit skip cycles.
WINDOWS = (0.06, 0.16, 0.4, None)
_CONVERGED = 1e-5
_NOTHING = 1e-3  # of a fall of the cost
_INSIDE = 1e-9
# Times a rival's cost: what is still above that after two rounds is given up.
HOPELESS = 1.5
# A step that gains less than this share of what was expected asks for a new Jacobian.
_TRUSTED = 0.25
_LEAST_STEP = 1e-7
# Of a step that the data see: what leaves no kink within it.
_FINER = 0.05
# A quotient that grows by so much as its step gets finer is of a jump: a joint sticks once more.
JUMP = 3.0


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
        absorbed: (unknowns, unknowns) covariance of what the unknowns took up of numbers that are
            never exact; None where everything is.
        held: the part of the cost by which what is never exact is not where it is stated; None
            where that is not integrated out, or only the first part was fitted.
        by_record: (records,) chi-square of each, see `TakenUp`; None as `held`.
    """

    hypothesis: Hypothesis
    residuals: list[FloatArray]
    jacobians: list[FloatArray] | None
    cost: float
    records: tuple[MeasuredRecord, ...]
    end: float | None
    absorbed: FloatArray | None = None
    held: float | None = None
    by_record: FloatArray | None = None

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
        return np.asarray(total + prior_precision(self.hypothesis))

    def covariance(self) -> FloatArray:
        """(unknowns, unknowns) of the transformed unknowns."""
        matrix = self.normal_matrix()
        scale = np.sqrt(np.maximum(matrix.diagonal(), 1e-300))
        inverse = np.linalg.pinv(matrix / np.outer(scale, scale)) / np.outer(scale, scale)
        return np.asarray(inverse if self.absorbed is None else inverse + self.absorbed)


def prior_precision(hypothesis: Hypothesis) -> FloatArray:
    """(unknowns, unknowns) of what is known beforehand, 0 where nothing is."""
    unknowns = hypothesis.unknowns()
    found = np.diag([u.prior[1] ** -2 if u.prior else 0.0 for u in unknowns])
    told = {label for label, *_ in hypothesis.priors}
    where = {hypothesis.effects[u.effect].label: k for k, u in enumerate(unknowns) if u.prior}
    kept, precision = hypothesis.known.precision(where.keys() - told - hypothesis.freed)
    at = [where[label] for label in kept]
    found[np.ix_(at, at)] = precision
    return found


def from_prior(hypothesis: Hypothesis) -> FloatArray:
    """(unknowns,) how far the unknowns are from what is known beforehand."""
    means = np.array([u.prior[0] if u.prior else 0.0 for u in hypothesis.unknowns()])
    return hypothesis.vector() - means


def prior_cost(hypothesis: Hypothesis) -> float:
    """Sum of squares of the priors."""
    off = from_prior(hypothesis)
    return float(off @ prior_precision(hypothesis) @ off)


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
    slopes: list[FloatArray] | None = None,
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
        slopes: the Jacobian at the start values, where it is known.
    """
    chosen = tuple(problem.records if records is None else records)
    here, given = hypothesis, slopes
    residuals = problem.residuals(here.effects, chosen, end)
    cost = _square(residuals) + prior_cost(here)
    damping = 1e-3
    steps: FloatArray | None = None
    fresh, refined, turn = slopes is not None, False, 0
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
        known, vector = prior_precision(here), here.vector()
        normal = sum(j.T @ j for j in slopes) + known
        gradient = sum(j.T @ r.ravel() for j, r in zip(slopes, residuals, strict=True))
        gradient = gradient + known @ from_prior(here)
        if not (np.isfinite(normal).all() and np.isfinite(gradient).all()):
            break
        improved = False
        for _ in range(7 if fresh else 2):
            step = bounded_step(unknowns, vector, normal, gradient, damping)
            # Where rounding decides, all dampings would be tried for nothing.
            if fresh and -float(2.0 * gradient @ step + step @ normal @ step) < _NOTHING:
                break
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
        slopes = updated(slopes, residuals, there, moved, _scale(normal))
        here, residuals, cost = trial, there, value
        damping = max(damping / 8.0, 1e-9)
        small = gained < _CONVERGED * cost + 1e-3
        if small and (fresh or near is not None):
            fresh = False
            break
        fresh = False
        if small or gained < _TRUSTED * expected:
            slopes = None
    if with_jacobian and here is hypothesis and given is not None:
        slopes = given
    elif with_jacobian and problem.marginal is not None and is_nonsmooth(here):
        slopes = central_jacobian(problem, here, chosen, end, residuals)
    elif with_jacobian and not (fresh and slopes is not None):
        slopes = jacobian(problem, here, chosen, end, residuals, steps)
    absorbed = None
    if with_jacobian and problem.marginal is not None:
        unknown = [(here.effects[u.effect].label, u.name) for u in here.unknowns()]
        absorbed = problem.marginal.absorbed_covariance(unknown)
    taken = None if end is not None else problem.taken_up(here.effects, chosen)
    return Fit(
        here,
        residuals,
        slopes if with_jacobian else None,
        cost,
        chosen,
        end,
        absorbed,
        None if taken is None else taken.held,
        None if taken is None else taken.by_record,
    )


def is_nonsmooth(hypothesis: Hypothesis) -> bool:
    """Whether a small change of an unknown may change the motion a lot."""
    return any(effect.where == "nonlinear" for effect in hypothesis.effects)


def _square(residuals: Sequence[FloatArray]) -> float:
    with np.errstate(over="ignore", invalid="ignore"):  # of a trial far off
        total = float(sum((r * r).sum() for r in residuals))
    return total if np.isfinite(total) else np.inf


def _scale(normal: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.maximum(np.diag(normal), 1e-12 * np.diag(normal).max() + 1e-300)))


def bounded_step(
    unknowns: Sequence[Unknown],
    vector: FloatArray,
    normal: FloatArray,
    gradient: FloatArray,
    damping: float,
) -> FloatArray:
    """The damped step from `vector` that stays within the bounds of the unknowns."""
    scale = _scale(normal)
    low = np.array([u.lower for u in unknowns]) - vector
    high = np.array([u.upper for u in unknowns]) - vector

    def solve(block: FloatArray, right: FloatArray, index: NDArray[np.intp]) -> FloatArray:
        size = scale[index]
        damped = block / np.outer(size, size) + damping * np.eye(index.size)
        return np.asarray(np.linalg.lstsq(damped, right / size, rcond=None)[0] / size)

    return bounded_solution(normal, -gradient, low, high, solve, _INSIDE)


def fit_growing(
    problem: Problem,
    hypothesis: Hypothesis,
    records: Sequence[MeasuredRecord] | None = None,
    *,
    windows: Sequence[float | None] = WINDOWS,
    iterations: int = 6,
    near: Fit | None = None,
) -> Fit:
    """Fit up to one time after the other.

    Args:
        problem: the data.
        hypothesis: where to start.
        records: to fit; all where None.
        windows: s, ends of the growing stretch that is fitted; None for the whole record.
        iterations: of the last window; the others take 3.
        near: a fit nearby, whose slopes may be used again.

    Returns:
        the fit to the last window.
    """
    *first, last = windows
    for end in first:
        hypothesis = fit(problem, hypothesis, records, end, iterations=3, near=near).hypothesis
    return fit(problem, hypothesis, records, last, iterations=iterations, near=near)


def fits_without(best: Fit, refit: Callable[[Hypothesis], Fit]) -> list[Fit]:
    """A fit without one of its causes, each in turn, as far as there is a model without it.

    Args:
        best: the fit with all of them.
        refit: fits what is left.
    """
    labels = [cause.label for cause in best.hypothesis.causes]
    fits = [
        attempt(f"without {label}", partial(refit, best.hypothesis.minus(label)))
        for label in labels
    ]
    return [each for each in fits if each is not None]


# Jacobians of residuals: by differences, from a fit nearby, or updated from step to step.


def jacobian(
    problem: Problem,
    hypothesis: Hypothesis,
    records: Sequence[MeasuredRecord],
    end: float | None,
    at: list[FloatArray],
    steps: FloatArray | None = None,
    first: Sequence[FloatArray] | None = None,
    *,
    both: bool = False,
) -> list[FloatArray]:
    """D residual / d unknowns of every record, (channels x m, unknowns).

    By how modes and force change, where that is all and the motion is linear; else by differences.

    Args:
        problem: data and noise.
        hypothesis: where.
        records: which.
        end: s.
        at: the residuals there.
        steps: (unknowns,) of the differences; the unknowns' own where None.
        first: the first columns, where they are known.
        both: half a step to either side, exact to the second order.
    """
    unknowns = hypothesis.unknowns()
    known = first[0].shape[1] if first else 0
    columns: dict[int, list[FloatArray]] = {
        k: [part[:, k] for part in first or ()] for k in range(known)
    }
    columns |= _by_modes(problem, hypothesis, range(known, len(unknowns)), records, end)
    for k, unknown in enumerate(unknowns):
        if k in columns:
            continue
        step = unknown.step if steps is None else float(steps[k])
        ahead = _difference(problem, hypothesis, k, 0.5 * step if both else step, records, end, at)
        if both:
            back = _difference(problem, hypothesis, k, -0.5 * step, records, end, at)
            ahead = [between(a, b) for a, b in zip(ahead, back, strict=True)]
        columns[k] = ahead
    return [
        np.stack([columns[k][i] for k in range(len(unknowns))], axis=1)
        if unknowns
        else np.zeros((part.size, 0))
        for i, part in enumerate(at)
    ]


def central_jacobian(
    problem: Problem,
    hypothesis: Hypothesis,
    records: Sequence[MeasuredRecord],
    end: float | None,
    at: list[FloatArray],
) -> list[FloatArray]:
    """As `jacobian`, to the second order, and where the motion has kinks by the finest steps.

    What no record can tell, such as the scale of all forces and sensors, stays untold only where
    the columns cancel: a step in which a joint sticks once more is off by a fifth.

    Args:
        problem: data and noise.
        hypothesis: where.
        records: which.
        end: s.
        at: the residuals there.
    """
    if not is_nonsmooth(hypothesis):
        return jacobian(problem, hypothesis, records, end, at, both=True)
    coarse = jacobian(problem, hypothesis, records, end, at)
    steps = _FINER * fine_steps(coarse, hypothesis.unknowns())
    found = jacobian(problem, hypothesis, records, end, at, steps, both=True)
    for fine, plain in zip(found, coarse, strict=True):
        # A jump within even the finest step is no slope.
        jumps = np.linalg.norm(fine, axis=0) > JUMP * np.linalg.norm(plain, axis=0)
        fine[:, jumps] = plain[:, jumps]
    return found


def between(ahead: FloatArray, behind: FloatArray) -> FloatArray:
    """A slope from those to either side; where a jump is to one side, that to the other.

    Args:
        ahead: quotient of differences.
        behind: the same to the other side.
    """
    sizes = np.linalg.norm(ahead), np.linalg.norm(behind)
    if max(sizes) > JUMP * min(sizes):
        return ahead if sizes[0] < sizes[1] else behind
    return 0.5 * (ahead + behind)


def _by_modes(
    problem: Problem,
    hypothesis: Hypothesis,
    wanted: Iterable[int],
    records: Sequence[MeasuredRecord],
    end: float | None,
) -> dict[int, list[FloatArray]]:
    """The columns of those wanted that are known without integrating anew."""
    unknowns, vector = hypothesis.unknowns(), hypothesis.vector()
    found: dict[int, tuple[float, tuple[Hypothesis, Hypothesis]]] = {}
    for k in wanted:
        unknown = unknowns[k]
        if hypothesis.effects[unknown.effect].where not in BY_MODES:
            continue
        ends = [
            min(max(vector[k] + way * unknown.step, unknown.lower), unknown.upper)
            for way in (-0.5, 0.5)
        ]
        if ends[0] < ends[1]:
            before, after = (hypothesis.at(np.where(np.arange(len(vector)) == k, e, vector))
                             for e in ends)  # fmt: skip
            found[k] = ends[1] - ends[0], (before, after)
    if not found:
        return {}
    pairs = [(before.effects, after.effects) for _, (before, after) in found.values()]
    looked = partial(problem.changes, hypothesis.effects, pairs, records, end)
    changes = attempt("slopes by modes", looked) or [None] * len(pairs)
    return {
        k: [part.ravel() / apart for part in change]
        for (k, (apart, _)), change in zip(found.items(), changes, strict=True)
        if change is not None
    }


def _difference(
    problem: Problem,
    hypothesis: Hypothesis,
    k: int,
    step: float,
    records: Sequence[MeasuredRecord],
    end: float | None,
    at: Sequence[FloatArray],
) -> list[FloatArray]:
    """One column by a difference; the other way at a bound, or where there is no model."""
    vector, unknown = hypothesis.vector(), hypothesis.unknowns()[k]
    if not unknown.lower <= vector[k] + step <= unknown.upper:
        step = -step
    moved = vector.copy()
    moved[k] += step
    try:
        there = problem.residuals(hypothesis.at(moved).effects, records, end)
    except InputError:  # no model there, such as springs that gravity overturns
        step = -step
        moved[k] = vector[k] + step
        there = problem.residuals(hypothesis.at(moved).effects, records, end)
    return [((a - b) / step).ravel() for a, b in zip(there, at, strict=True)]


def fine_steps(parts: Sequence[FloatArray], unknowns: Sequence[Unknown]) -> FloatArray:
    """Steps that change the residuals by about two standard deviations all in all.

    The time of a blow's edge is known to a microsecond: a step of a thousandth would carry late
    edges past samples, and its difference quotient would say nothing of the slope.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # of a motion that diverges
        norms = np.sqrt(sum((part**2).sum(axis=0) for part in parts))
    norms = np.where(np.isfinite(norms), norms, np.inf)
    own = np.array([u.step for u in unknowns])
    return np.asarray(np.clip(2.0 / np.maximum(norms, 1e-12), _LEAST_STEP, own))


def borrowed(
    hypothesis: Hypothesis,
    residuals: Sequence[FloatArray],
    near: Hypothesis,
    near_slopes: Sequence[FloatArray],
    near_residuals: Sequence[FloatArray],
) -> list[FloatArray] | None:
    """The first columns of the Jacobian, from a fit nearby, cut to these residuals' length.

    None where the nearby fit's unknowns are not the first of these.
    """
    own = [(u.effect, u.name) for u in hypothesis.unknowns()]
    known = [(u.effect, u.name) for u in near.unknowns()]
    if own[: len(known)] != known:
        return None
    found = []
    for slopes, whole, part in zip(near_slopes, near_residuals, residuals, strict=True):
        channels, count = whole.shape
        shaped = slopes.reshape(channels, count, -1)[:, : part.shape[1]]
        found.append(shaped.reshape(part.size, -1))
    return found


def updated(
    slopes: Sequence[FloatArray],
    before: Sequence[FloatArray],
    after: Sequence[FloatArray],
    moved: FloatArray,
    scale: FloatArray,
) -> list[FloatArray]:
    """Broyden's update: the least change that agrees with what the step did."""
    weighted = scale**2 * moved
    along = float(moved @ weighted)
    if not along > 0.0:
        return list(slopes)
    return [
        j + np.outer((new - old).ravel() - j @ moved, weighted / along)
        for j, old, new in zip(slopes, before, after, strict=True)
    ]
