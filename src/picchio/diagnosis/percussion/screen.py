"""Screening: how much of what is left could each effect explain, at a size that matters?

Each effect is really put into the model, at a finite size, and the change it makes is compared
with the residual after the nuisances' own changes are taken out of both: no derivative, which
misses what only acts beyond a threshold.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.diagnosis.percussion.fit import Fit, prior_weights
from picchio.diagnosis.percussion.latent import LATENT, latent_gain
from picchio.diagnosis.percussion.problem import Problem
from picchio.model import Effect
from picchio.model.effects import Scales

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
        weights = prior_weights(fit.hypothesis)
        jacobian = np.concatenate([*fit.jacobians, np.diag(weights)])
        norms = np.linalg.norm(jacobian, axis=0)
        # What stands at its bound is no longer free to explain anything.
        vector = fit.hypothesis.vector()
        inside = [
            u.lower + 1e-6 < x < u.upper - 1e-6
            for u, x in zip(fit.hypothesis.unknowns(), vector, strict=True)
        ]
        keep = (norms > 0.0) & np.array(inside, dtype=bool)
        q, r = np.linalg.qr(jacobian[:, keep] / norms[keep])
        good = np.abs(r.diagonal()) > 1e-8
        self.basis = q[:, good]
        self.extra = weights.size

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
    """

    def __init__(
        self,
        problem: Problem,
        fit: Fit,
        scales: Scales,
        faint: bool = False,
        enough: float = 0.0,
    ) -> None:
        self.problem, self.fit, self.scales, self.faint = problem, fit, scales, faint
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

    def suspect(self, candidate: tuple[type[Effect], str]) -> Suspect | None:
        """What an effect at a target promises; None where it can't act, or is known already."""
        kind, target = candidate
        if f"{kind.name}:{target}" in self.fit.hypothesis.labels:
            return None
        if kind.name in LATENT:
            return latent_gain(self.problem, self.fit, kind, target, self.project, self.left)
        if kind.discrete and self.faint:
            return None  # what has no small size would have been seen before
        if self.first is not None:
            glance = self.first.suspect(candidate)
            if glance is None or glance.gain < _FIRST * self.enough / _EVERY:
                return glance
        trials = [kind(target, **values) for values in kind(target).trials(self.scales)]
        if self.faint:
            trials = [self._faint(trial) for trial in trials]
        return _suspect(
            self.problem, self.fit, trials, self.project, self.left, self.faint, self.beyond
        )

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
        values = _resized(trial, _FAINT / change)
        return type(trial)(trial.target, **values)

    def ranked(self, suspects: Iterable[Suspect | None]) -> list[Suspect]:
        """The most promising first."""
        found = [s for s in suspects if s is not None]
        return sorted(found, key=lambda s: -(s.gain - s.numbers * math.log(self.left.size)))


def _part(fit: Fit) -> Fit:
    """Every third record of a fit, as if it had been fitted to those alone."""
    assert fit.jacobians is not None
    return replace(
        fit,
        records=fit.records[::_EVERY],
        residuals=fit.residuals[::_EVERY],
        jacobians=fit.jacobians[::_EVERY],
    )


def _suspect(
    problem: Problem,
    fit: Fit,
    trials: Sequence[Effect],
    project: Projector,
    left: FloatArray,
    faint: bool,
    beyond: float,
) -> Suspect | None:
    base, columns, kept = flat(fit.residuals), [], []

    def change(trial: Effect) -> FloatArray | None:
        try:
            effects = fit.hypothesis.plus(trial).effects
            return flat(problem.residuals(effects, fit.records, fit.end)) - base
        except InputError:  # at this size the model is none
            return None

    several = _vector(trials)
    for trial in trials:
        moved = change(trial)
        if moved is None:
            continue
        tried = [(trial, moved)]
        large = float(np.linalg.norm(moved)) / beyond
        if large > _LARGE and not faint and not trial.discrete:
            smaller = type(trial)(trial.target, **_resized(trial, 1.0 / large))
            moved = change(smaller) if smaller.values != trial.values else None
            if moved is not None:
                tried = [(smaller, moved)] if several else [*tried, (smaller, moved)]
        for one, moved in tried:
            columns.append(project(moved[:, None])[:, 0])
            kept.append(one)
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
    gains = np.where(alone > 0.0, (alone * size) ** 2, 0.0)
    # What is small acts alike either way, a factor as well as a difference.
    linear = all(
        (p.neutral == 0.0 and p.lower < 0.0) or (faint and p.neutral == 1.0 and p.logarithmic)
        for p in kept[0].parameters
    )
    if linear:
        gains = (alone * size) ** 2
    numbers = len(kept[0].parameters)
    if kept[0].discrete:
        # nothing lies between its sizes: the residual as it would be
        totals = np.array([((left + m) ** 2).sum() for m in moves.T])
        gains = (left**2).sum() - totals
        order = np.argsort(-gains)
        starts = tuple(kept[i] for i in order[:2])
        return Suspect(starts[0], float(gains[order[0]]), 4, starts)
    if several and _vector(kept):
        weights = np.linalg.lstsq(moves, -left, rcond=None)[0]
        total = float(left @ left - ((left + moves @ weights) ** 2).sum())
        values: dict[str, float] = {}
        for trial, weight in zip(kept, weights, strict=True):
            for p in trial.parameters:
                if trial.values[p.name] != p.neutral:
                    values[p.name] = float(np.clip(weight, -6.0, 6.0)) * trial.values[p.name]
        start = _bounded(kept[0], values)
        return Suspect(start, total, numbers, (start,))
    order = np.argsort(-gains)
    starts = tuple(_scaled(kept[i], float(alone[i]), linear) for i in order[:2])
    span = float(left @ left - _leave(moves, left))
    return Suspect(starts[0], max(float(gains[order[0]]), 0.7 * span), numbers, starts)


def _leave(moves: FloatArray, left: FloatArray) -> float:
    weights = np.linalg.lstsq(moves, -left, rcond=None)[0]
    return float(((left + moves @ weights) ** 2).sum())


def _vector(trials: Sequence[Effect]) -> bool:
    """Whether the trials move one parameter each, as a vector's components."""
    moved = [tuple(p.name for p in t.parameters if t.values[p.name] != p.neutral) for t in trials]
    return len(trials) > 1 and len(set(moved)) == len(moved) and all(len(m) == 1 for m in moved)


def _scaled(trial: Effect, weight: float, signed: bool) -> Effect:
    """The trial made larger or smaller as the residual asks."""
    size = float(np.clip(abs(weight), 0.05, 8.0))
    return _bounded(trial, _resized(trial, math.copysign(size, weight) if signed else size))


def _resized(trial: Effect, size: float) -> dict[str, float]:
    """A trial's values with its distance from doing nothing so many times as large."""
    values = dict(trial.values)
    for p in trial.parameters:
        value = values[p.name]
        if value == p.neutral or not math.isfinite(value):
            continue
        if p.neutral == 0.0 and not p.logarithmic:
            new = value * size
        elif p.neutral == 1.0 and p.logarithmic:
            new = math.exp(math.log(value) * float(np.clip(size, -3.0, 3.0)))
        elif math.isinf(p.neutral) and p.name in ("stiffness", "limit"):
            new = value / size if p.name == "stiffness" else value
        else:
            continue
        values[p.name] = min(max(new, p.lower), p.upper)
    return {p.name: values[p.name] for p in trial.parameters if values[p.name] != p.neutral}


def _bounded(trial: Effect, values: dict[str, float]) -> Effect:
    """The effect with values brought within their bounds."""
    bounds = {p.name: (p.lower, p.upper) for p in trial.parameters}
    inside = {k: min(max(v, bounds[k][0]), bounds[k][1]) for k, v in values.items()}
    return type(trial)(trial.target, **inside)
