"""Screening: how much of what is left could each effect explain, at a size that matters?

Each effect is really put into the model, at a finite size, and the change it makes is compared
with the residual after the nuisances' own changes are taken out of both: no derivative, which
misses what only acts beyond a threshold.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.fit.drawn import blow_by_blow, drawn_cost, hidden_columns
from picchio.diagnosis.percussion.fit.least_squares import Fit, fit, prior_cost, prior_precision
from picchio.diagnosis.percussion.fit.unknowns import TOLERATED
from picchio.model.effects.effect import Effect
from picchio.model.effects.scales import Scales

# Trials of an effect made smaller or larger.


def moves_one_each(trials: Sequence[Effect]) -> bool:
    """Whether the trials move one parameter each, as a vector's components."""
    moved = [tuple(p.name for p in t.parameters if t.values[p.name] != p.neutral) for t in trials]
    return len(trials) > 1 and len(set(moved)) == len(moved) and all(len(m) == 1 for m in moved)


def acts_either_way(kind: type[Effect], faint: bool) -> bool:
    """Whether an effect may have either sign; a `faint` factor acts as a difference does."""
    return all(
        (p.neutral == 0.0 and p.lower < 0.0) or (faint and p.neutral == 1.0 and p.logarithmic)
        for p in kind.parameters
    )


def smallest(trials: Sequence[Effect]) -> Effect:
    """Of trials of an effect of one parameter, that which is nearest to doing nothing."""

    def size(trial: Effect) -> float:
        (p,) = trial.parameters
        value = trial.values[p.name]
        return abs(math.log(value)) if p.logarithmic and p.neutral == 1.0 else abs(value)

    return min(trials, key=size)


def scaled(trial: Effect, weight: float, signed: bool) -> Effect:
    """The trial made larger or smaller as the residual asks."""
    size = float(np.clip(abs(weight), 0.05, 8.0))
    return resized(trial, math.copysign(size, weight) if signed else size)


def resized(trial: Effect, size: float) -> Effect:
    """A trial with its distance from doing nothing so many times as large."""
    values = dict(trial.values)
    for p in trial.parameters:
        value = values[p.name]
        if value == p.neutral or not math.isfinite(value) or p.whole:
            continue
        if p.neutral == 0.0 and not p.logarithmic:
            new = value * size
        elif p.neutral == 1.0 and p.logarithmic:
            new = math.exp(math.log(value) * float(np.clip(size, -3.0, 3.0)))
        elif p.by_inverse:
            new = value / size
        else:
            continue
        values[p.name] = min(max(new, p.lower), p.upper)
    return type(trial)(trial.target, **values)


# Late blows that the screening tries.
_LOOKED_AT = 1.8
_FAINT = 20.0
_SOME = 3
# A first look is at every so-manyth record; what promises there less than so much of its share of
# what is asked for is not looked at further.
_EVERY = 3
_FIRST = 0.6
_CHANCE = 4.0
# A trial that changes the data by so many times what is left beyond noise is tried smaller, too.
_LARGE = 3.0


@dataclass(frozen=True, eq=False)
class Suspect:
    """An effect and how much of the residual it could explain.

    Attributes:
        effect: at the size it was tried.
        gain: fall of chi-square that the screening promises.
        numbers: how many free numbers the effect has; what costs less counts as a part of one.
        starts: other sizes to start the fit from, the best first.
    """

    effect: Effect
    gain: float
    numbers: float
    starts: tuple[Effect, ...]

    @property
    def label(self) -> str:
        """Effect and target."""
        return self.effect.label


class Projector:
    """Takes what the nuisances and the causes found so far can do out of a change."""

    def __init__(self, fit: Fit) -> None:
        assert fit.jacobians is not None
        size, shapes = np.linalg.eigh(prior_precision(fit.hypothesis))
        root = np.sqrt(np.maximum(size, 0.0))[:, None] * shapes.T
        jacobian = np.concatenate([*fit.jacobians, root])
        norms = np.linalg.norm(jacobian, axis=0)
        # What stands at its bound is no longer free to explain anything.
        vector = fit.hypothesis.vector()
        inside = [u.is_inside(x) for u, x in zip(fit.hypothesis.unknowns(), vector, strict=True)]
        keep = (norms > 0.0) & np.array(inside, dtype=bool)
        q, r = np.linalg.qr(jacobian[:, keep] / norms[keep])
        good = np.abs(r.diagonal()) > 1e-8
        self.basis = q[:, good]
        self.extra = len(root)

    def __call__(self, flat: FloatArray) -> FloatArray:
        """(samples,) or (samples, k) made orthogonal to the nuisances."""
        pad = np.zeros((self.extra, *flat.shape[1:]))
        full = np.concatenate([flat, pad])
        return np.asarray(full - self.basis @ (self.basis.T @ full))


def flat(parts: Sequence[FloatArray]) -> FloatArray:
    """All records' residuals in one row."""
    return np.concatenate([part.ravel() for part in parts])


class Screen:
    """Tells every candidate's promise.

    Args:
        problem: data and noise.
        fit: of what is known so far, with its Jacobian; the same records and time are used.
        scales: sizes that matter.
        faint: whether only what hardly stands out of the noise is looked for. A typical size is
            then far too large: late in a record it no longer looks like a small one.
        enough: a fall of chi-square below which a promise is of no use.
        early: whether these are the first few cycles, where a narrow resonance can be met.
    """

    def __init__(
        self,
        problem: Problem,
        fit: Fit,
        scales: Scales,
        faint: bool = False,
        enough: float = 0.0,
        early: bool = False,
    ) -> None:
        self.problem, self.fit, self.scales = problem, fit, scales
        self.faint, self.early = faint, early
        self.project = Projector(fit)
        self.left = self.project(flat(fit.residuals))
        self.enough, self.first = enough, None
        # Chance alone promises one or two: below that a glance tells nothing.
        if enough * _FIRST / _EVERY > _CHANCE and len(fit.records) > _EVERY:
            self.first = Screen(problem, _part(fit), scales, faint)

    @property
    def total(self) -> float:
        """Chi-square that is left to explain."""
        return float(self.left @ self.left)

    @property
    def beyond(self) -> float:
        """Standard deviations that are left beyond noise, all in all."""
        count = self.left.size
        return math.sqrt(max(self.total - count, 3.0 * math.sqrt(2.0 * count)))

    # A trial far too large may diverge: it is tried smaller.
    @np.errstate(over="ignore", invalid="ignore")
    def suspect(self, candidate: tuple[type[Effect], str]) -> Suspect | None:
        """What an effect at a target promises; None where it can't act, or is known already."""
        kind, target = candidate
        if f"{kind.name}:{target}" in self.fit.hypothesis.labels:
            return None
        if kind.latent is not None:
            starts = kind(target).tried_at(self.scales)
            return self._latent(starts)
        if kind.discrete and self.faint:
            return None  # what has no small size would have been seen before
        if self.first is not None:
            glance = self.first.suspect(candidate)
            if glance is None or glance.gain < _FIRST * self.enough / _EVERY:
                return glance
        bare = kind(target)
        trials = bare.tried_at(self.scales, early=self.early)
        if self.faint:
            if acts_either_way(kind, faint=True) and len(kind.parameters) == 1:
                trials = [smallest(trials)]  # the others would become the same
            trials = [self._faint(trial) for trial in trials]
        found = _judged(*self._changes(trials), self.left, self.faint)
        if found is None:
            return None
        gain = max(found.gain + self._freed(found.effect), self._exceeding.get(found.label, 0.0))
        return replace(found, gain=gain)

    @cached_property
    def _exceeding(self) -> dict[str, float]:
        """Of what stands for a tolerance: the fall of chi-square where it may be exceeded."""
        problem, known, end = self.problem, self.fit, self.fit.end
        if problem.marginal is None:
            return {}
        raw = problem.unmarginalised(known.hypothesis.effects, known.records, end)
        names = [record.name for record in known.records]
        return problem.marginal.freed(raw, names, known.hypothesis.labels)

    def _freed(self, effect: Effect) -> float:
        """What a value that leaves its tolerance no longer costs; the least, where it asks to."""
        known = self.fit.hypothesis
        freed = max(prior_cost(known) - prior_cost(known.plus(effect)), 0.0)
        return max(freed, TOLERATED**2) if effect.label in known.at_ends else freed

    def _latent(self, starts: Sequence[Effect]) -> Suspect:
        """What an effect's hidden numbers could explain; `starts` is it as its trials have it."""
        known, start, latent = self.fit, starts[0], starts[0].latent
        assert latent is not None
        if latent.linear:
            gain = 0.0
            for each in starts:
                effects = known.hypothesis.plus(each).effects
                there = self.problem.residuals(effects, known.records, known.end)
                fall = known.chi_square - sum(float((r * r).sum()) for r in there)
                if fall > gain:
                    start, gain = each, fall
            count = latent.size(0) * len(known.records)
            return _promise(start, gain, count, known.samples)
        fall, numbers = 0.0, 0
        slopes = hidden_columns(self.problem, known, start)
        for residual, columns in zip(known.residuals, slopes, strict=True):
            if columns.shape[1] == 0:
                continue
            weights = np.linalg.lstsq(columns, -residual.ravel(), rcond=1e-6)[0]
            fall += float((residual**2).sum() - ((residual.ravel() + columns @ weights) ** 2).sum())
            numbers += columns.shape[1]
        if latent.times and known.end is not None:
            fall = max(fall, self._late_share(start) * self.total)
        if start.discrete:
            return Suspect(start, fall, numbers, (start,))
        return _promise(start, fall, numbers, known.samples)

    def _late_share(self, start: Effect) -> float:
        """What share of the residual the times of the first late blows explain.

        A blow that comes late by more than its own edges' width is not seen in any slope.
        """
        problem, known = self.problem, self.fit
        interval = min(r.setup.blows.interval for r in known.records)
        end = min((1 + _LOOKED_AT) * interval, known.end or math.inf)
        try:
            first = fit(problem, known.hypothesis, known.records, end, iterations=3)
            begun = blow_by_blow(problem, replace(first, end=end), start)
            late = fit(problem, begun, known.records, end, iterations=2)
        except InputError:  # led to where there is no model
            return 0.0
        return max(1.0 - late.chi_square / max(first.chi_square, 1e-300), 0.0)

    def _changes(self, trials: Sequence[Effect]) -> tuple[list[Effect], list[FloatArray]]:
        """The trials, smaller ones where they are far too large, and what they change."""
        fit, base = self.fit, flat(self.fit.residuals)

        def change(trial: Effect) -> FloatArray | None:
            try:
                effects = fit.hypothesis.plus(trial).effects
                return flat(self.problem.residuals(effects, fit.records, fit.end)) - base
            except InputError:  # at this size the model is none
                return None

        components = moves_one_each(trials)
        kept: list[Effect] = []
        columns: list[FloatArray] = []
        for trial in trials:
            moved = change(trial)
            if moved is None:
                continue
            tried = [(trial, moved)]
            large = float(np.linalg.norm(moved)) / self.beyond
            if large > _LARGE and not self.faint and not trial.discrete:
                smaller = resized(trial, 1.0 / large)
                moved = change(smaller) if smaller.values != trial.values else None
                if moved is not None:  # of a vector's components one size each
                    tried = [(smaller, moved)] if components else [*tried, (smaller, moved)]
            for one, moved in tried:
                columns.append(self.project(moved[:, None])[:, 0])
                kept.append(one)
        return kept, columns

    def _faint(self, trial: Effect) -> Effect:
        """The trial so small that it changes the data by some standard deviations all in all."""
        fit = self.fit
        # The first few: what one direction of the force does not show another does.
        some = fit.records[:_SOME]
        try:
            effects = fit.hypothesis.plus(trial).effects
            there = flat(self.problem.residuals(effects, some, fit.end))
        except InputError:
            return trial
        change = float(np.linalg.norm(there - flat(fit.residuals[: len(some)])))
        change *= math.sqrt(len(fit.records) / len(some))
        if not change > _FAINT:
            return trial
        return resized(trial, _FAINT / change)

    def ranked(self, suspects: Iterable[Suspect | None]) -> list[Suspect]:
        """The most promising first."""
        found = [s for s in suspects if s is not None]
        return sorted(found, key=lambda s: -(s.gain - s.numbers * math.log(self.left.size)))


def _promise(start: Effect, fall: float, count: int, samples: int) -> Suspect:
    """A suspect with numbers that are drawn: they cost less than as many free ones."""
    cost = drawn_cost(fall, count, samples)
    return Suspect(start, fall, 1 + cost / math.log(max(samples, 2)), (start,))


def _part(fit: Fit) -> Fit:
    """Every third record of a fit, as if it had been fitted to those alone."""
    assert fit.jacobians is not None
    return replace(
        fit,
        records=fit.records[::_EVERY],
        residuals=fit.residuals[::_EVERY],
        jacobians=fit.jacobians[::_EVERY],
    )


def _judged(
    kept: Sequence[Effect], columns: Sequence[FloatArray], left: FloatArray, faint: bool
) -> Suspect | None:
    """What the trials of one effect explain of what is left, by the change each makes."""
    if not kept:
        return None
    moves = np.stack(columns, axis=1)
    size = np.linalg.norm(moves, axis=0)
    alive = size > 1e-6
    if not alive.any():
        return None
    moves, size = moves[:, alive], size[alive]
    kept = [t for t, a in zip(kept, alive, strict=True) if a]
    # the residual falls by the part of it that the change (of either size) can undo
    alone = (moves.T @ -left) / size**2
    linear = acts_either_way(type(kept[0]), faint)
    gains = np.where(linear | (alone > 0.0), (alone * size) ** 2, 0.0)
    numbers = len(kept[0].fitted)
    if kept[0].discrete:
        # nothing lies between its sizes: the residual as it would be
        totals = np.array([((left + m) ** 2).sum() for m in moves.T])
        gains = (left**2).sum() - totals
        order = np.argsort(-gains)
        starts = tuple(kept[i] for i in order[:2])
        return Suspect(starts[0], float(gains[order[0]]), 4, starts)
    weights = np.linalg.lstsq(moves, -left, rcond=None)[0]
    span = float(left @ left - ((left + moves @ weights) ** 2).sum())
    if moves_one_each(kept):
        values: dict[str, float] = {}
        for trial, weight in zip(kept, weights, strict=True):
            for p in trial.parameters:
                if trial.values[p.name] != p.neutral:
                    values[p.name] = float(np.clip(weight, -6.0, 6.0)) * trial.values[p.name]
        start = kept[0].bounded(**values)
        return Suspect(start, span, numbers, (start,))
    order = np.argsort(-gains)
    starts = tuple(scaled(kept[i], float(alone[i]), linear) for i in order[:2])
    return Suspect(starts[0], max(float(gains[order[0]]), 0.7 * span), numbers, starts)
