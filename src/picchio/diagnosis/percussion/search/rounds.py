"""One look at the records: some are searched for causes, the others must confirm them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from picchio.diagnosis.percussion.criteria.bic import bic
from picchio.diagnosis.percussion.criteria.pose_consistency import pose_inconsistency
from picchio.diagnosis.percussion.criteria.whiteness import Evidence, whiteness_test
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.data.record import MeasuredRecord
from picchio.diagnosis.percussion.data.split import Split
from picchio.diagnosis.percussion.fit.drawn import LATENT
from picchio.diagnosis.percussion.fit.least_squares import Fit, fit, fit_growing
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.search.candidates import measure_scales
from picchio.diagnosis.percussion.search.select import Search, refit, search
from picchio.model.effects.effect import Effect
from picchio.model.effects.scales import Scales


@dataclass(frozen=True, eq=False)
class Look:
    """A search in some of the records, others being held out.

    Attributes:
        train: records that were fitted.
        kept: those held out.
        baseline: nuisances alone, fitted to the first.
        scales: sizes in this campaign.
        found: the search.
    """

    train: list[MeasuredRecord]
    kept: list[MeasuredRecord]
    baseline: Fit
    scales: Scales
    found: Search

    @property
    def gained(self) -> float:
        """Fall of BIC by what was found."""
        return bic(self.baseline) - bic(self.found.best)

    def nominal(self, problem: Problem) -> tuple[Fit, Evidence]:
        """The nuisances alone, fitted to all records, and what that leaves."""
        if self.found.best.hypothesis.labels:
            nominal = fit(problem, self.baseline.hypothesis, problem.records, None, iterations=3)
        else:
            nominal = refit(problem, self.found.best.hypothesis, problem.records)
        return nominal, fit_evidence(problem, nominal)


def look(
    problem: Problem,
    candidates: Sequence[tuple[type[Effect], str]],
    split: Split,
    progress: Callable[[str], None] | None,
) -> Look:
    """Search for causes in some of the records; the others must confirm them.

    Args:
        problem: data and noise.
        candidates: effects and targets.
        split: records to fit, and records held out.
        progress: told what is being done.
    """
    train, kept = split
    if progress is not None:
        progress("fitting the nominal model within its tolerance")
    start = Hypothesis.baseline(problem.robot, problem.campaign.tolerance)
    baseline = fit_growing(problem, start, train)
    effects = baseline.hypothesis.effects
    scales = measure_scales(problem, effects, problem.predictions(effects))

    def held_out_gain(before: Fit, after: Fit) -> float | None:
        names = {e.name for e in after.hypothesis.causes}
        if not kept or names & set(LATENT):
            return None
        old = _chi_square(problem, before.hypothesis, kept)
        return old - _chi_square(problem, after.hypothesis, kept)

    found = search(problem, candidates, scales, train, baseline, held_out_gain, progress=progress)
    return Look(train, kept, baseline, scales, found)


def fit_evidence(problem: Problem, whole: Fit) -> Evidence:
    """What a fit to all records leaves, and whether its unknowns hold at every pose."""
    return replace(
        whiteness_test(problem, whole.residuals), pose_inconsistency=pose_inconsistency(whole)
    )


def _chi_square(
    problem: Problem, hypothesis: Hypothesis, records: Sequence[MeasuredRecord]
) -> float:
    return float(sum((r * r).sum() for r in problem.residuals(hypothesis.effects, records)))
