"""Causes taken out or replaced by others: what was chosen first may be wrong."""

from __future__ import annotations

from collections.abc import Iterator, Set
from dataclasses import replace
from functools import partial

from picchio.diagnosis.attempt import attempt
from picchio.diagnosis.percussion.criteria.equivalence import bic, count_numbers
from picchio.diagnosis.percussion.criteria.remainder import allowed
from picchio.diagnosis.percussion.fit.drawn import fit_latent, with_hidden
from picchio.diagnosis.percussion.fit.least_squares import HOPELESS, Fit, fit, fits_without
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.search.alike import NEARLY, settled_alike, settled_by_itself
from picchio.diagnosis.percussion.search.state import Search, Trial
from picchio.diagnosis.percussion.search.trials import (
    SCREEN_WINDOW,
    SHORT_LIST,
    records_of_every_pose,
    try_candidates,
)
from picchio.diagnosis.percussion.tolerance.linearise import About, about_another

# What share of what the chosen one explained a rival may lack to be settled beside other causes.
_NEAR = 0.1


def prune(search: Search, found: Fit, *, alone: bool = True) -> Fit:
    """Take out every cause, the newest included, that the others do without; the idlest first.

    With `alone` the last one, too: a fit with a cause in it goes on where the fit without it had
    stopped, and what it gains may be the nuisances' doing.
    """
    best = found
    while len(best.hypothesis.causes) > (0 if alone else 1):
        # To the end, however far behind at first: the cause may have moved a stuck fit on.
        fits = fits_without(best, partial(search.fit, iterations=5))
        idlest = min(fits, key=bic, default=best)
        if idlest is best or bic(idlest) >= bic(best) + search.least:
            break
        best = idlest
    return best


def refit_latent(search: Search, best: Fit, newest: str) -> Fit:
    """What earlier causes draw anew in every record, looked for again beside the newest cause."""
    for cause in best.hypothesis.drawing:
        if cause.label != newest:
            # From the start: without the newest cause some numbers may have been far off.
            start = replace(best, hypothesis=with_hidden(best.hypothesis, cause, {}))
            again = attempt(cause.label, partial(fit_latent, search.problem, start, cause))
            best = again if again is not None and again.cost < best.cost else best
    return best


def exchange(search: Search) -> Fit:
    """The best fit, with an earlier cause replaced by a close rival where that now does better.

    The first cause is chosen while the others still disturb: a rival may have been the right one.
    """
    best = search.best
    for chosen, rival in _earlier(search):
        joined = _in_its_place(search, best, chosen, rival)
        if joined is not None:
            other = attempt(rival.label, partial(_exchanged, search, joined, best))
            if other is not None and bic(other) < bic(best) - search.least:
                best = other
    return best


def exchange_settled(search: Search, simpler: bool = False) -> tuple[Fit, About] | None:
    """As `exchange`, each fit about its own inexact numbers; and about what it is linearised.

    Args:
        search: what was found, step by step.
        simpler: try rivals with no more numbers alone. Where only noise is left, what was chosen
            may still be more than it takes: while a friction was missing, a hysteresis, which
            loses energy, made up for a spring. Or it is alike, and leaves a little more: blows
            that are shorter than stated, of those that are rounder.

    Returns:
        None where no rival that came near does better so, or where everything is exact.
    """
    best, found = search.best, None
    for chosen, rival in _earlier(search) if allowed(search.problem) else ():
        if simpler and count_numbers(rival.fit.hypothesis) > count_numbers(chosen.fit.hypothesis):
            continue
        explained = max(search.baseline.cost - chosen.fit.cost, 0.0)
        joined = _in_its_place(search, best, chosen, rival)
        if joined is None or rival.fit.cost - chosen.fit.cost > _NEAR * explained:
            continue
        start = attempt(rival.label, partial(search.fit, joined, iterations=6))
        if start is not None:
            other, about = settled_by_itself(search, rival.label, start)
            if other is not None and bic(other) < bic(best) - search.least:
                best = other
                found = other, about
    return found


def in_an_earlier_place(search: Search, newest: Trial) -> tuple[Fit, About] | None:
    """The newest cause in the place of an earlier one; and about what that is linearised.

    Where tolerances make up for most of what is wrong, their slopes may let another cause seem the
    best. Beside that the right one adds little; in its place it does better.

    Args:
        search: what stands without the newest.
        newest: the cause, fitted beside what stands.

    Returns:
        None where it does not do better in any place, or where everything is exact.
    """
    if not allowed(search.problem):
        return None
    for label in search.labels:
        start = replace(newest.fit, hypothesis=newest.fit.hypothesis.minus(label))
        with about_another(search.problem, newest.about):
            other, about = settled_by_itself(search, newest.label, start, anew=False)
        if other is None or search.pays(search.best, other, about) < search.least:
            continue
        if search.confirmed(other, about):
            return other, about
    return None


def _earlier(search: Search) -> Iterator[tuple[Trial, Trial]]:
    """What was chosen before the newest cause, with each of its rivals."""
    return ((step[0], rival) for step in search.steps[:-1] for rival in step[1:])


def _in_its_place(search: Search, best: Fit, chosen: Trial, rival: Trial) -> Hypothesis | None:
    """A rival in place of what was chosen, beside the other causes; None where it can't be."""
    labels, joined = best.hypothesis.labels, rival.fit.hypothesis
    if chosen.label not in labels or rival.label in labels:
        return None
    if rival.draws or not rival.finished(search.records):
        return None
    for cause in best.hypothesis.causes:
        if cause.label not in (chosen.label, *joined.labels):
            joined = joined.joined(cause)
    for label in joined.labels - labels - {rival.label}:  # what is not needed any more
        joined = joined.minus(label)
    return joined


def _exchanged(search: Search, hypothesis: Hypothesis, best: Fit) -> Fit | None:
    """A hypothesis fitted; None where it is hopeless on the first part of some records."""
    problem, some = search.problem, records_of_every_pose(search.records)
    own = fit(problem, best.hypothesis, some, SCREEN_WINDOW, iterations=2)
    begun = fit(problem, hypothesis, some, SCREEN_WINDOW, iterations=4, rival=own.cost)
    if begun.cost >= HOPELESS * own.cost:
        return None
    return search.fit(begun.hypothesis, iterations=6, rival=best.cost)


def rivals_of(search: Search, best: Fit, label: str, short_list: int = SHORT_LIST) -> list[Trial]:
    """A fit with one cause replaced by each of its rivals, the best first.

    Args:
        search: what is found is kept in it.
        best: the fit.
        label: of the cause.
        short_list: how many suspects to fit.
    """
    known = search.replacements.get(label)
    if known is None or known[0] is not best:
        others = best.hypothesis.minus(label)
        looked = partial(
            try_candidates, search, others, cause=label, best=best, short_list=short_list
        )
        known = search.replacements[label] = (best, attempt(f"rivals of {label}", looked) or [])
    return known[1]


def replace_causes(search: Search, settled: Set[str] = frozenset()) -> tuple[Fit, About]:
    """The best fit with every cause in turn replaced by whichever does better, until noise is left.

    What was added one by one need not be the best set: the first stands for several at once.
    Causes that are `settled` were the best beside the others. Rivals that explain nearly as much
    are compared each about its own inexact numbers: those of what stands suit that alone.

    Args:
        search: what was found; it stays.
        settled: labels of causes.

    Returns:
        the fit, and about what the records are linearised for it.
    """
    problem, best = search.problem, search.best
    with about_another(problem):
        for cause in best.hypothesis.causes:
            if cause.label in settled or cause.label not in best.hypothesis.labels:  # taken out
                continue
            trials = rivals_of(search, best, cause.label)
            rest = partial(search.fit, best.hypothesis.minus(cause.label), iterations=5)
            without = attempt(f"without {cause.label}", rest) if allowed(problem) else None
            if without is not None:
                near = NEARLY * (without.cost - best.cost)
                trials = settled_alike(search, trials, best, near=near)
            if trials and trials[0].score < bic(best) - search.least:
                if trials[0].about is not None:
                    trials[0].about.restore(problem)
                best = refit_latent(search, prune(search, trials[0].fit), trials[0].label)
                if search.leaves_noise(best):
                    break
        return best, About.of(problem)
