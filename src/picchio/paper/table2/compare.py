"""The hypotheses of Table 2 compared: the same freedom, a penalty, entries left out."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.paper.assumptions import Assumptions
from picchio.paper.printed import Printed
from picchio.paper.table2.by_curve import penalty, rounding_of
from picchio.paper.table2.fit import Fit, Target, described, evaluate, refine
from picchio.paper.table2.place import FREE, Place, limits
from picchio.paper.table2.rules import Rule, at_mean, rules

SEED = 0
_TRIED, _STARTED = 1500, 14
_PARTS = 10  # of the worlds tried: what fits into a cache is done at once
_ROUGH, _FINE, _AGAIN = 20, 60, 8  # steps of a fit

Trial = tuple[Place, FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class Compared:
    """A hypothesis, how well it fits and predicts.

    Attributes:
        fit: to all entries but the one aside.
        aside: index of the life set aside as a misprint, or None.
        parameters: numbers fitted, the world's included.
        bic: Bayesian information criterion; less is better.
        left_out_mean: (8,) ln error of each mean stress, predicted from the other 15 entries.
        left_out_life: (8,) the same for each N.
    """

    fit: Fit
    aside: int | None
    parameters: int
    bic: float
    left_out_mean: FloatArray
    left_out_life: FloatArray

    @property
    def name(self) -> str:
        """Of the hypothesis."""
        return self.fit.rule.name

    @property
    def mean_rms(self) -> float:
        """Of the mean stresses, ln; shown on the page."""
        return float(np.sqrt((self.fit.mean_errors**2).mean()))

    @property
    def life_rms(self) -> float:
        """Of the lives but the one aside, ln; shown on the page."""
        errors = self.fit.life_errors
        kept = errors if self.aside is None else np.delete(errors, self.aside)
        return float(np.sqrt((kept**2).mean()))

    @property
    def left_out(self) -> float:
        """Median error of a life predicted from the other entries, ln."""
        return float(np.nanmedian(np.abs(self.left_out_life)))

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "name": self.name,
            "parameters": self.parameters,
            "set_aside": self.aside,
            "bic": self.bic,
            "mean_errors": self.fit.mean_errors,
            "life_errors": self.fit.life_errors,
            "left_out_mean": self.left_out_mean,
            "left_out_life": self.left_out_life,
            "world": described(self.fit),
        }


@dataclass(frozen=True, eq=False)
class Comparison:
    """All hypotheses, best first; and other worlds that give the same means.

    Attributes:
        hypotheses: best first.
        alike: worlds that come about as near to the eight means as the best does.
    """

    hypotheses: tuple[Compared, ...]
    alike: tuple[Fit, ...]


def compare_hypotheses(
    printed: Printed, given: Assumptions, progress: Callable[[int, int], None] | None = None
) -> Comparison:
    """Fit every hypothesis with the same freedom and compare."""
    every = rules(printed.task.hits_per_rivet)
    target = Target(printed)
    families: dict[tuple[str, str], list[Trial]] = {}
    found = []
    for k, rule in enumerate(every):
        family = (rule.measure, rule.inertia_about)
        if family not in families:
            families[family] = _trials(rule, given, printed)
        found.append(_compare(rule, families[family], target))
        if progress is not None:
            progress(k + 1, len(every))
    found.sort(key=lambda c: c.bic)
    means = Rule("means alone", at_mean, None)
    blank = Target(printed, life=np.full(8, 1e-9))
    return Comparison(tuple(found), tuple(_starts(means, families[("peak", "cg")], blank)))


def _trials(rule: Rule, given: Assumptions, printed: Printed) -> list[Trial]:
    """Random worlds with their deflections, for all rules that look at the same quantity."""
    rng = np.random.default_rng(SEED)
    low, high = limits()
    trials = []
    for (r, c), elbow in product(((3, 5), (5, 3)), ("down", "up")):
        base = given.but(rows=r, columns=c, elbow=elbow, inertia_about=rule.inertia_about)
        place = Place(base, rule.measure)
        for few in np.array_split(rng.random((_TRIED, len(FREE))), _PARTS):
            vectors = low + (high - low) * few
            every = zip(vectors, place.deflections(vectors, printed), strict=True)
            trials += [(place, v, found) for v, found in every if not np.isnan(found).any()]
    return trials


def _starts(rule: Rule, trials: list[Trial], target: Target) -> list[Fit]:
    """The trials that suit a rule best, refined; best first."""
    own = np.array([target.printed.sn_curve.exponent] if rule.free_exponent else [])
    scored = []
    for place, v, found in trials:
        fit = evaluate(rule, place, np.append(v, own), target, found)
        assert fit is not None
        scored.append(fit)
    scored.sort(key=lambda f: f.cost)
    fits = [refine(rule, f.place, f.vector, target, _ROUGH) for f in scored[:_STARTED]]
    return sorted(fits, key=lambda f: f.cost)


def _compare(rule: Rule, trials: list[Trial], target: Target) -> Compared:
    first = _starts(rule, trials, target)[0]
    plain = refine(rule, first.place, first.vector, target, _FINE)
    worst = int(np.abs(plain.life_errors).argmax())
    # One life may be a misprint, at the cost of a parameter.
    part = target.without("life", worst)
    aside = refine(rule, plain.place, plain.vector, part, _FINE)
    counts = len(FREE) + 1 + rule.extra
    scored = [
        (_bic(plain, target, counts), plain, None, counts, target),
        (_bic(aside, part, counts + 1), aside, worst, counts + 1, part),
    ]
    value, fit, out, parameters, kept = min(scored, key=lambda s: s[0])
    return Compared(
        fit, out, parameters, value,
        _left_out(fit, kept, "mean"), _left_out(fit, kept, "life"),
    )  # fmt: skip


def _bic(fit: Fit, target: Target, parameters: int) -> float:
    """One error for the means and one for the lives, neither smaller than rounding."""
    finite, printed = target.finite, target.printed
    rounding = rounding_of(printed.stress[finite], printed.cycles[finite], fit.exponent)
    total = penalty(parameters + 2, 16)
    for errors, weight, least in (
        (fit.mean_errors, target.mean, 0.005 / printed.stress[finite]),
        (fit.life_errors, target.life, rounding),
    ):
        count = float(weight.sum())
        variance = float((weight * errors**2).sum()) / count + float((least**2).mean()) / 3.0
        total += count * (math.log(2.0 * math.pi * variance) + 1.0)
        # A misprint may be anywhere within ln ± 3.
        total += 2.0 * math.log(6.0) * (len(weight) - count)
    return total


def _left_out(fit: Fit, target: Target, kind: str) -> FloatArray:
    """Ln error of each entry, predicted by a fit to the others."""
    weights = target.mean if kind == "mean" else target.life
    errors = np.full(8, np.nan)
    for k in np.flatnonzero(weights):
        part = target.without(kind, int(k))
        again = refine(fit.rule, fit.place, fit.vector, part, _AGAIN)
        errors[k] = (again.mean_errors if kind == "mean" else again.life_errors)[k]
    return errors
