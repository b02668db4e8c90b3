"""What the loadings ask for beside joint springs, and what is left on loadings left out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import gammaln

from picchio.core.arrays import FloatArray, IndexArray
from picchio.diagnosis.stiffness.fit import Fit, Problem, fit
from picchio.diagnosis.stiffness.prior import Suspect

STRONG = 3.0
"""The least gain in log evidence beyond the count of candidates (Kass and Raftery, JASA 90 (1995)
773, doi:10.1080/01621459.1995.10476572: 'strong')."""
FOLDS = 6
_MOST, _BEAM = 3, 3  # suspects at once; sets of them that are followed up


@dataclass(frozen=True)
class HeldOut:
    """What a fit to the other loadings says of loadings left out, all of them once.

    Attributes:
        score: log density of their readings, more is better.
        rms: by group of readings, m or rad, of the residual.
        signal: likewise, of the readings.
        nominal: likewise, of the residual with the stated stiffness.
        by_row: (rows,) the score of each loading.
    """

    score: float
    rms: dict[str, float]
    signal: dict[str, float]
    nominal: dict[str, float]
    by_row: FloatArray

    @property
    def nrmse(self) -> float:
        """The residual over the signal, the groups together."""
        return self._over(self.rms)

    @property
    def before(self) -> float:
        """The same of the stated stiffness."""
        return self._over(self.nominal)

    def _over(self, sizes: dict[str, float]) -> float:
        ratio = [(sizes[g] / self.signal[g]) ** 2 for g in sizes if self.signal[g] > 0.0]
        return math.sqrt(sum(ratio) / len(ratio)) if ratio else math.nan


def folds(problem: Problem, count: int = FOLDS, seed: int = 0) -> IndexArray:
    """(rows,) in which fold each loading is left out; what shares a zero stays together.

    Args:
        problem: the loadings.
        count: of folds; fewer where there are fewer loadings.
        seed: of the draw.
    """
    together = []
    for k, table in enumerate(problem.tables):
        for row in range(len(table)):
            own = int(table.set[row])
            together.append((k, -1 - row) if own < 0 else (k, own))
    names = {one: i for i, one in enumerate(dict.fromkeys(together))}
    mixed = np.random.default_rng(seed).permutation(len(names)) % min(count, len(names))
    return np.asarray(mixed[[names[one] for one in together]])


def held_out(found: Fit, parts: IndexArray) -> HeldOut:
    """Leave each fold out once, fit the others, and look at it.

    Args:
        found: of all loadings; the fits to the others begin there.
        parts: (rows,) as `folds` makes them.

    Returns:
        how well loadings are foretold that were not fitted.
    """
    problem = found.problem
    scores = np.zeros(problem.rows)
    total = {group: np.zeros(4) for group in problem.groups}
    stated = problem.predict(np.zeros(len(problem.precision)))
    ends = np.cumsum([len(table) for table in problem.tables])[:-1]
    for fold in range(int(parts.max()) + 1):
        out = parts == fold
        if out.all():
            continue
        other = fit(problem, ~out, start=found)
        predicted = problem.predict(other.mean)
        first = 0
        for k, (table, keep) in enumerate(zip(problem.tables, np.split(out, ends), strict=True)):
            rows = first + np.flatnonzero(keep)
            first += len(table)
            if not len(rows):
                continue
            residual, slope = predicted[k].residual[keep], predicted[k].slope[keep]
            size = np.array([other.noise[group] for group in table.groups])
            own = predicted[k].own
            spread = np.diag(size**2) + np.zeros((int(keep.sum()), 1, 1))
            if own is not None:
                spread = (
                    spread + (own if own.ndim == 3 else own[..., None] * np.eye(len(size)))[keep]
                )
            spread = spread + slope @ other.covariance @ slope.swapaxes(1, 2)
            scores[rows] = _log_density(residual, spread, other.tails)
            for group in problem.groups:
                of = [g == group for g in table.groups]
                total[group] += (
                    (residual[:, of] ** 2).sum(), (table.values[keep][:, of] ** 2).sum(),
                    (stated[k].residual[keep][:, of] ** 2).sum(), residual[:, of].size,
                )  # fmt: skip

    def rms(part: int) -> dict[str, float]:
        return {g: math.sqrt(x[part] / x[3]) if x[3] else math.nan for g, x in total.items()}

    return HeldOut(float(scores.sum()), rms(0), rms(1), rms(2), scores)


def _log_density(residual: FloatArray, spread: FloatArray, v: float) -> FloatArray:
    """(m,) of Student's t (normal for infinite v) with scale matrices (m, r, r)."""
    r = residual.shape[1]
    square = np.einsum("mr,mr->m", residual, np.linalg.solve(spread, residual[..., None])[..., 0])
    logdet = np.linalg.slogdet(spread)[1]
    if math.isinf(v):
        return np.asarray(-0.5 * (square + logdet + r * math.log(2.0 * math.pi)))
    return np.asarray(
        gammaln(0.5 * (v + r)) - gammaln(0.5 * v) - 0.5 * r * math.log(v * math.pi)
        - 0.5 * logdet - 0.5 * (v + r) * np.log1p(square / v)
    )  # fmt: skip


@dataclass(frozen=True)
class Tried:
    """What was tried beside the joints' springs.

    Attributes:
        suspect: which.
        gain: in log evidence.
        held_out: gain in the log density of loadings left out; NaN where that was not asked.
        taken: whether it is in the answer.
    """

    suspect: Suspect
    gain: float
    held_out: float
    taken: bool


@dataclass(frozen=True, eq=False)
class Answer:
    """The fit with what the loadings ask for, and how sure that is.

    Attributes:
        fit: the most probable one.
        left_out: what it says of loadings left out.
        alone: the same of the joints' springs alone.
        tried: whatever was tried, what was taken first.
        mean: (n,) of the logarithms of the joints' stiffness over the stated ones, by all fits
            that are about as probable.
        covariance: (n, n), likewise.
        weights: probability of each set of suspects that was tried.
    """

    fit: Fit
    left_out: HeldOut
    alone: HeldOut
    tried: tuple[Tried, ...]
    mean: FloatArray
    covariance: FloatArray
    weights: dict[frozenset[Suspect], float]

    def confidence(self, suspect: Suspect) -> float:
        """The probability of a suspect, whatever else there is.

        Args:
            suspect: which.
        """
        return sum(weight for causes, weight in self.weights.items() if suspect in causes)


def select(problem: Problem, candidates: Sequence[Suspect]) -> Answer:
    """The fit with what the loadings ask for, one suspect after another.

    A suspect is taken if the evidence for it is strong, whatever else was tried, and loadings left
    out are foretold better with it. What others would do about as well as it is not lost: the
    stiffness is the mean over all fits, each with its probability (Bayesian model averaging;
    Hoeting et al., Stat. Sci. 14 (1999) 382, doi:10.1214/ss/1009212519).

    Args:
        problem: with the joints' springs alone.
        candidates: what there may be beside them.

    Returns:
        the answer.
    """
    found, parts = fit(problem), folds(problem)
    alone = left = held_out(found, parts)
    price = math.log(max(len(candidates), 1))
    seen: dict[frozenset[Suspect], Fit] = {frozenset(): found}
    beam = [found]
    taken: list[Tried] = []
    refused: list[Tried] = []
    for _ in range(_MOST):
        level: dict[frozenset[Suspect], Fit] = {}
        for base in beam:
            for suspect in candidates:
                both = frozenset((*base.problem.causes, suspect))
                if suspect not in base.problem.causes and both not in level:
                    level[both] = with_suspect(base, suspect)
        seen |= level
        own = frozenset(found.problem.causes)
        refused = [
            Tried(next(iter(causes - own)), one.evidence - found.evidence, math.nan, False)
            for causes, one in level.items() if own < causes
        ]  # fmt: skip
        best = max(level.values(), key=lambda one: one.evidence, default=found)
        if best.evidence - found.evidence < STRONG + price:
            break
        after = held_out(best, parts)
        new = [one for one in best.problem.causes if one not in own]
        good = after.score > left.score
        told = [Tried(s, best.evidence - found.evidence, after.score - left.score, good)
                for s in new]  # fmt: skip
        refused = [one for one in refused if one.suspect not in new]
        if not good:
            refused = [*told, *refused]
            break
        taken = [one for one in taken if one.suspect in best.problem.causes] + told
        found, left = best, after
        close = sorted(level.values(), key=lambda one: -one.evidence)[:_BEAM]
        beam = [one for one in close if best.evidence - one.evidence < STRONG]
    probable = np.array([one.evidence - price * len(causes) for causes, one in seen.items()])
    weights = np.exp(probable - probable.max())
    weights /= weights.sum()
    n = problem.joints
    both_of = list(zip(weights.tolist(), seen.values(), strict=True))
    mean = sum((w * one.mean[:n] for w, one in both_of), np.zeros(n))
    covariance = np.zeros((n, n))
    for weight, one in both_of:
        away = one.mean[:n] - mean
        covariance += weight * (one.covariance[:n, :n] + np.outer(away, away))
    likely = {frozenset(causes): w for w, causes in zip(weights.tolist(), seen, strict=True)}
    return Answer(found, left, alone, (*taken, *refused), mean, covariance, likely)


def with_suspect(found: Fit, suspect: Suspect) -> Fit:
    """The fit with a suspect, begun at one without it.

    Args:
        found: without it.
        suspect: the further cause.
    """
    old = found.problem
    problem = replace(old, causes=(*old.causes, suspect))
    at = np.zeros(len(problem.precision))
    at[: old.springs] = found.mean[: old.springs]
    at[old.springs : problem.springs] = math.log(2.0)  # at first twice as stiff as it may be
    first, before = problem.springs, old.springs
    for k, name in enumerate(old.steps):
        ratio = old.size_of(name) / problem.size_of(name)
        at[first + problem.steps.index(name)] = ratio * found.mean[before + k]
    zeros = len(problem.zeros)
    if zeros:
        at[-zeros:] = found.mean[-zeros:]
    return fit(problem, start=replace(found, mean=at))
