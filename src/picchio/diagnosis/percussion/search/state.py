"""The search for causes: its data, and what it has found so far."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from picchio.diagnosis.attempt import attempt
from picchio.diagnosis.percussion.criteria.equivalence import bic
from picchio.diagnosis.percussion.criteria.remainder import (
    Remainder,
    allowed,
    decisive_gain,
    tempered_evidence,
)
from picchio.diagnosis.percussion.criteria.whiteness import whiteness_test
from picchio.diagnosis.percussion.data.problem import MeasuredRecord, Problem, signal_power
from picchio.diagnosis.percussion.fit.least_squares import Fit, fit
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.tolerance.linearise import About, about_another
from picchio.model.effects.effect import Effect
from picchio.model.effects.registry import effect_class
from picchio.model.effects.scales import Scales

# Fall of BIC below which nothing is claimed: with a hundred candidates tried, chance alone
# reaches it in less than one of a thousand campaigns.
LEAST_GAIN = 8.0
# The forward model itself is exact to about this share of the signal (sensors smear jumps, second
# order in the deflection): what gains less than that is no cause.
EXACT = 3e-4


@dataclass(frozen=True, eq=False)
class Trial:
    """One candidate fitted.

    Attributes:
        label: of its effect and target.
        fit: to the records that were looked at.
        score: BIC; infinite where it was not fitted to the end.
        promise: fall of chi-square that its screening expected.
        about: what the records were linearised about where it was settled by itself; else None.
        stands: the same without slopes, to go on from once they are not kept.
        in_vain: whether it was settled by itself and came to nothing better.
    """

    label: str
    fit: Fit
    score: float
    promise: float
    about: About | None = None
    stands: About | None = None
    in_vain: bool = False

    def put_by(self) -> Trial:
        """The trial as one that was not chosen: its slopes need not be kept."""
        if self.about is None:
            return self
        return replace(self, about=None, stands=self.about.without_slopes())

    @property
    def draws(self) -> bool:
        """Whether its effect draws numbers anew in every record."""
        return effect_class(self.label.partition(":")[0]).latent is not None

    def finished(self, records: Sequence[MeasuredRecord]) -> bool:
        """Whether it was fitted to all of these records, to their ends.

        Args:
            records: all that are fitted.
        """
        return len(self.fit.records) == len(records) and self.fit.end is None


@dataclass(eq=False)
class Search:
    """A search for causes in some of the records, others being held out.

    Attributes:
        problem: data and noise.
        candidates: effects and targets that may be causes.
        scales: sizes that matter in this campaign.
        records: that are fitted.
        kept: those held out, which must confirm what is found.
        baseline: nuisances alone, fitted to the first.
        about: what the records were linearised about for it.
        best: the hypothesis that stands, fitted to the first; the baseline to begin with.
        say: told what is being done.
        finer: effects and targets that tell another cause with more numbers.
        steps: per step the trials, the best first.
        stood: labels of causes -> the fit with these beside which more were looked for, and about
            what the records were linearised for it.
        pinned: whether noise was all that was left, and what is known is held fixed since.
        replacements: label of a cause -> the fit it was replaced in, and the trials.
    """

    problem: Problem
    candidates: Sequence[tuple[type[Effect], str]]
    scales: Scales
    records: Sequence[MeasuredRecord]
    kept: Sequence[MeasuredRecord]
    baseline: Fit
    best: Fit
    say: Callable[[str], None] = lambda text: None
    finer: Sequence[tuple[type[Effect], str]] = ()
    steps: list[list[Trial]] = field(default_factory=list)
    stood: dict[frozenset[str], tuple[Fit, About]] = field(default_factory=dict)
    pinned: bool = False
    replacements: dict[str, tuple[Fit, list[Trial]]] = field(default_factory=dict)
    least: float = field(init=False)
    about: About = field(init=False)

    def __post_init__(self) -> None:
        self.least, self.about = LEAST_GAIN, About.of(self.problem)
        if not allowed(self.problem):
            self.least = max(LEAST_GAIN, EXACT**2 * signal_power(self.records))

    @property
    def labels(self) -> frozenset[str]:
        """Of the causes that stand."""
        return self.best.hypothesis.labels

    @property
    def considered(self) -> frozenset[str]:
        """Of all that may be causes."""
        return frozenset(f"{kind.name}:{target}" for kind, target in self.candidates)

    @property
    def gained(self) -> float:
        """Fall of BIC by what was found."""
        return bic(self.baseline) - bic(self.best)

    def before(self, label: str) -> tuple[Fit, About]:
        """What stood before a cause, as in `stood`; the baseline where that is not known.

        Args:
            label: of one of the causes that stand.
        """
        return self.stood.get(self.labels - {label}, (self.baseline, self.about))

    def fit(self, hypothesis: Hypothesis, iterations: int, rival: float = float("inf")) -> Fit:
        """A hypothesis fitted to all of the records that are fitted.

        Args:
            hypothesis: where to start.
            iterations: at most.
            rival: cost of a fit that it must come near; one that stays far above is given up.
        """
        return fit(self.problem, hypothesis, self.records, None, iterations=iterations, rival=rival)

    def pays(self, without: Fit, found: Fit, about: About | None = None) -> float:
        """By how much a fit beats another one, in units of chi-square.

        Where a remainder is allowed, the records held out count as well: evidence is counted by
        poses.

        Args:
            without: the fit that lacks something.
            found: the fit that has it.
            about: what the records were linearised about for it; as now where None.
        """
        gain = bic(without) - bic(found)
        if not allowed(self.problem):
            return gain
        before = self._with_held_out(without)
        with about_another(self.problem, about):
            whole = attempt("records held out", lambda: self._with_held_out(found))
        if whole is None or len(whole[0].records) != len(before[0].records):
            return min(gain, decisive_gain(without, found))
        if not (before[1] or whole[1]):
            return min(gain, decisive_gain(before[0], whole[0]))
        with about_another(self.problem, about):
            after = tempered_evidence(self.problem, whole[0])
        return min(gain, tempered_evidence(self.problem, before[0]) - after)

    def _with_held_out(self, found: Fit) -> tuple[Fit, bool]:
        """A fit with what it leaves of the records held out, where they can tell.

        And whether what is not exact would be absurdly far off for it.
        """
        effects, kept = found.hypothesis.effects, self.kept
        if any(e.latent is not None for e in found.hypothesis.causes):
            kept = ()
        taken = self.problem.taken_up(effects, (*found.records, *kept))
        absurd = taken is not None and taken.is_absurd
        if not kept:
            return found, absurd
        left = self.problem.residuals(effects, kept)
        whole = replace(
            found,
            records=(*found.records, *kept),
            residuals=[*found.residuals, *left],
            jacobians=None,
            held=None if taken is None else taken.held,
            by_record=None if taken is None else taken.by_record,
            cost=found.cost + float(sum((r * r).sum() for r in left)),
        )
        return whole, absurd

    def explains_enough(self, found: Fit) -> bool:
        """Whether what a fit with causes leaves is no more than a remainder that is allowed.

        It does not where a nuisance is held back by the end of its tolerance: that one may be what
        is wrong, and the causes stand in for it.

        Args:
            found: the fit.
        """
        hypothesis = found.hypothesis
        if not allowed(self.problem) or not hypothesis.causes or hypothesis.at_ends:
            return False
        left, before = (
            Remainder.of(each, whiteness_test(self.problem, each))
            for each in (found, self.baseline)
        )
        return left.may_be_named(before)

    def leaves_noise(self, found: Fit) -> bool:
        """Whether noise is all that a fit leaves.

        Args:
            found: the fit.
        """
        return whiteness_test(self.problem, found).is_noise

    def held_out_gain(self, before: Fit, after: Fit, about: About | None = None) -> float | None:
        """The fall of chi-square in the records held out; None where they can't tell.

        Args:
            before: a fit.
            after: a fit that should explain more.
            about: what the records were linearised about for it; as now where None.
        """
        if not self.kept or any(e.latent is not None for e in after.hypothesis.causes):
            return None

        def chi_square(found: Fit) -> float:
            left = self.problem.residuals(found.hypothesis.effects, self.kept)
            return float(sum((r * r).sum() for r in left))

        with about_another(self.problem, about):
            after_it = attempt("records held out", lambda: chi_square(after))
        # What is no model at a pose that was held out is refuted by it.
        return -math.inf if after_it is None else chi_square(before) - after_it

    def confirmed(self, other: Fit, about: About | None = None) -> bool:
        """Whether the records held out do not speak against a fit in place of the best.

        Args:
            other: the fit that would replace the best.
            about: what the records were linearised about for it; as now where None.
        """
        gain = self.held_out_gain(self.best, other, about)
        return gain is None or gain > 0.0
