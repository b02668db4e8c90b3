"""Other sets of causes that do as well as the one that was found, weighed on all records."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from picchio.diagnosis.attempt import attempt
from picchio.diagnosis.percussion.conclude.causes import fitted_causes
from picchio.diagnosis.percussion.criteria.equivalence import (
    SAME,
    bic,
    bic_difference,
    confidence,
)
from picchio.diagnosis.percussion.criteria.remainder import allowed, decisive_gain
from picchio.diagnosis.percussion.data.problem import MeasuredRecord, Problem
from picchio.diagnosis.percussion.fit.least_squares import Fit
from picchio.diagnosis.percussion.search.select import alternatives
from picchio.diagnosis.percussion.search.state import Search, Trial
from picchio.diagnosis.percussion.tolerance.in_turns import refit_in_turns
from picchio.diagnosis.percussion.tolerance.linearise import about_another, settled
from picchio.diagnosis.result import BEYOND_DOUBT, Cause

# Sets told beside the one that is claimed because they are not ruled out, at most.
_FEW = 2


def weighed(search: Search, whole: Fit) -> tuple[list[Trial], list[Trial], tuple[Cause, ...]]:
    """Other sets that do as well, all that were tried, and the causes with their confidence.

    Where one of several causes is beyond doubt but for a few rivals in its place, which leave as
    little, it is one of these: they are told with it.

    Args:
        search: what was found.
        whole: it, fitted to all records.
    """
    problem = search.problem
    # Over the same samples: else a rival may lose, or win, by which of them it knows.
    with problem.pinned(search.best.hypothesis.effects):
        same, rivals = alternatives(search)
        doubted = that_leave_doubt(search, rivals, same)
    with problem.pinned(whole.hypothesis.effects):
        same, refuted = _on_all_records(problem, whole, same)
        doubted, more = _on_all_records(problem, whole, doubted, BEYOND_DOUBT)
    # What does as well in some records may do worse in all, and yet not be ruled out by them.
    unsure = [
        trial
        for trial in refuted
        if len(search.labels) > 1 and confidence(whole, trial.fit) < BEYOND_DOUBT
    ]
    refuted = [trial for trial in refuted if trial not in unsure] + more
    doubted += unsure
    told = False
    if 0 < len(doubted) <= _FEW:
        labels = {trial.fit.hypothesis.labels for trial in doubted}
        rest = [trial for trial in rivals if trial.fit.hypothesis.labels not in labels]
        sure = fitted_causes(search, whole, rest, refuted)
        told = all(cause.confidence >= BEYOND_DOUBT for cause in sure)
    if told:
        same += doubted
    else:
        refuted += unsure
    return same, rivals, fitted_causes(search, whole, rivals, refuted)


def that_leave_doubt(search: Search, rivals: Sequence[Trial], same: Sequence[Trial]) -> list[Trial]:
    """Of the rivals of one of several causes, those that leave as little and are not ruled out.

    Args:
        search: what was found.
        rivals: other sets, fitted to the records of the search.
        same: those that do as well, which are known already.
    """
    known = {search.labels, *(trial.fit.hypothesis.labels for trial in same)}
    found = []
    for trial in rivals if len(search.labels) > 1 else ():
        labels = trial.fit.hypothesis.labels
        if labels in known or confidence(search.best, trial.fit) >= BEYOND_DOUBT:
            continue
        if search.leaves_noise(trial.fit) or search.explains_enough(trial.fit):
            known.add(labels)
            found.append(trial)
    return found


def _on_all_records(
    problem: Problem, whole: Fit, trials: Sequence[Trial], doubt: float = 0.0
) -> tuple[list[Trial], list[Trial]]:
    """Of rivals those that do as well on all records, the ones held out included; and the others.

    So do those of which it is not as sure as `doubt` that they do worse.
    """
    kept: list[Trial] = []
    refuted: list[Trial] = []
    for trial in trials:
        with about_another(problem):
            there = attempt(trial.label, partial(_refitted, problem, trial, whole.records))
        if there is None:
            continue
        alike = bic_difference(problem, whole, there) < SAME or confidence(whole, there) < doubt
        if allowed(problem):
            alike = alike or decisive_gain(there, whole) < SAME
        (kept if alike else refuted).append(replace(trial, fit=there, score=bic(there)))
    return kept, refuted


def _refitted(problem: Problem, trial: Trial, records: Sequence[MeasuredRecord]) -> Fit:
    """A trial fitted to all of these records, about its own inexact numbers."""
    found = refit_in_turns(problem, trial.fit.hypothesis, records)
    drawing = found.hypothesis.drawing
    return found if drawing else settled(problem, found, records, 1, anew=False)
