"""Causes taken out or replaced by others: what was chosen first may be wrong."""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import replace

from picchio.diagnosis.percussion.criteria.bic import bic
from picchio.diagnosis.percussion.criteria.whiteness import whiteness_test
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.data.record import MeasuredRecord
from picchio.diagnosis.percussion.fit.drawn import LATENT, fit_latent, with_hidden
from picchio.diagnosis.percussion.fit.least_squares import HOPELESS, Fit, fit
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.search.trials import (
    SCREEN_WINDOW,
    SHORT_LIST,
    Trial,
    records_of_every_pose,
    try_candidates,
)
from picchio.model.effects.effect import Effect
from picchio.model.effects.scales import Scales

# Label of a cause -> the fit it was replaced in, and the trials.
Tried = dict[str, tuple[Fit, list[Trial]]]


def prune(
    problem: Problem,
    found: Fit,
    records: Sequence[MeasuredRecord],
    least: float,
    *,
    alone: bool = True,
) -> Fit:
    """Take out every cause, the newest included, that the others do without; the idlest first.

    With `alone` the last one, too: a fit with a cause in it goes on where the fit without it had
    stopped, and what it gains may be the nuisances' doing.
    """
    best = found
    while len(best.hypothesis.causes) > (0 if alone else 1):
        # To the end, however far behind at first: the cause may have moved a stuck fit on.
        fits = [
            fit(problem, best.hypothesis.minus(cause.label), records, None, iterations=5)
            for cause in best.hypothesis.causes
        ]
        idlest = min(fits, key=bic)
        if bic(idlest) >= bic(best) + least:
            break
        best = idlest
    return best


def with_latent(problem: Problem, best: Fit, newest: str) -> Fit:
    """What earlier causes draw anew in every record, looked for again beside the newest cause."""
    for cause in best.hypothesis.causes:
        if cause.label != newest and cause.name in LATENT and cause.name != "mains_hum":
            kind = type(cause)
            # From the start: without the newest cause some numbers may have been far off.
            start = replace(best, hypothesis=with_hidden(best.hypothesis, kind, {}))
            again = fit_latent(problem, start, kind, cause.target)
            best = again if again.cost < best.cost else best
    return best


def exchange(
    problem: Problem,
    best: Fit,
    steps: Sequence[Sequence[Trial]],
    records: Sequence[MeasuredRecord],
    least: float,
) -> Fit:
    """The best fit, with an earlier cause replaced by a close rival where that now does better.

    The first cause is chosen while the others still disturb: a rival may have been the right one.

    Args:
        problem: data and noise.
        best: the fit.
        steps: the trials of every step, the one that was chosen first.
        records: that are fitted.
        least: fall of BIC that is asked for.
    """
    for step in steps[:-1]:
        for rival in step[1:]:
            chosen = step[0].label
            if chosen not in best.hypothesis.labels or not rival.finished(records):
                continue
            if rival.label in best.hypothesis.labels or rival.label.split(":")[0] in LATENT:
                continue
            joined = rival.fit.hypothesis
            for cause in best.hypothesis.causes:
                if cause.label not in (chosen, *joined.labels):
                    joined = joined.joined(cause)
            begun = _come_near(problem, joined, best, records)
            if begun is None:
                continue
            other = fit(problem, begun, records, None, iterations=6, rival=best.cost)
            if bic(other) < bic(best) - least:
                best = other
    return best


def _come_near(
    problem: Problem, hypothesis: Hypothesis, best: Fit, records: Sequence[MeasuredRecord]
) -> Hypothesis | None:
    """A hypothesis fitted to the first part of some records; None where that is hopeless."""
    some = records_of_every_pose(records)
    own = fit(problem, best.hypothesis, some, SCREEN_WINDOW, iterations=2)
    begun = fit(problem, hypothesis, some, SCREEN_WINDOW, iterations=4, rival=own.cost)
    return begun.hypothesis if begun.cost < HOPELESS * own.cost else None


def rivals_of(
    label: str,
    problem: Problem,
    best: Fit,
    candidates: Sequence[tuple[type[Effect], str]],
    scales: Scales,
    records: Sequence[MeasuredRecord],
    tried: Tried,
    short_list: int = SHORT_LIST,
) -> list[Trial]:
    """The best fit with one cause replaced by each of its rivals, the best first.

    Args:
        label: of the cause.
        problem: data and noise.
        best: the fit.
        candidates: effects and targets.
        scales: sizes that matter.
        records: that are fitted.
        tried: what was tried before; what is found is added.
        short_list: how many suspects to fit.
    """
    known = tried.get(label)
    if known is None or known[0] is not best:
        others = best.hypothesis.minus(label)
        trials = try_candidates(
            problem, others, candidates, scales, records,
            cause=label, best=best, short_list=short_list,
        )  # fmt: skip
        known = tried[label] = (best, trials)
    return known[1]


def replaced(
    problem: Problem,
    best: Fit,
    candidates: Sequence[tuple[type[Effect], str]],
    scales: Scales,
    records: Sequence[MeasuredRecord],
    least: float,
    tried: Tried,
    settled: Set[str] = frozenset(),
) -> Fit:
    """The best fit with every cause in turn replaced by whichever does better, until noise is left.

    What was added one by one need not be the best set: the first stands for several at once.
    What is tried is kept in `tried`. Causes that are `settled` were the best beside the others.
    """
    for cause in best.hypothesis.causes:
        if cause.label in settled or cause.label not in best.hypothesis.labels:  # taken out since
            continue
        trials = rivals_of(cause.label, problem, best, candidates, scales, records, tried)
        if trials and trials[0].score < bic(best) - least:
            newest = trials[0].label
            best = prune(problem, trials[0].fit, records, least)
            best = with_latent(problem, best, newest)
            if whiteness_test(problem, best.residuals, best.records).is_noise:
                break
    return best
