"""From percussion records to a verdict."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from picchio.campaign.campaign import Campaign
from picchio.core.processes import one_thread
from picchio.diagnosis.attempt import attempt
from picchio.diagnosis.life import Uncertain, life_before_and_after
from picchio.diagnosis.percussion.conclude.causes import (
    fitted_causes,
    fitted_nuisances,
    reported_covariance,
    with_solved,
)
from picchio.diagnosis.percussion.conclude.holdout import held_out_remainder, holdout_gain
from picchio.diagnosis.percussion.conclude.left_open import as_stated, fitted_spread, nominal_spread
from picchio.diagnosis.percussion.conclude.others import weighed
from picchio.diagnosis.percussion.conclude.verdict import (
    claimed_of,
    doubtful,
    leaves_little,
    may_be_partial,
    not_quiet,
    pair_of,
    verdict_of,
    why_not_claimed,
)
from picchio.diagnosis.percussion.criteria.common_fault import common_faults
from picchio.diagnosis.percussion.criteria.dominance import dominant_causes, explained_share
from picchio.diagnosis.percussion.criteria.equivalence import bic
from picchio.diagnosis.percussion.criteria.exceeded import exceeded
from picchio.diagnosis.percussion.criteria.pose_consistency import fit_evidence
from picchio.diagnosis.percussion.criteria.remainder import LEAST_EXPLAINED, Remainder, allowed
from picchio.diagnosis.percussion.criteria.whiteness import Evidence
from picchio.diagnosis.percussion.data.problem import MeasuredRecord, Problem, Split, held_out
from picchio.diagnosis.percussion.fit.drawn import refit, with_solved_numbers
from picchio.diagnosis.percussion.fit.least_squares import Fit, fit
from picchio.diagnosis.percussion.fit.parallel import parallel_records
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.follow_up.next_measurement import next_measurement
from picchio.diagnosis.percussion.search.candidates import (
    all_candidates,
    finer_candidates,
    warm_up,
)
from picchio.diagnosis.percussion.search.far import start_far
from picchio.diagnosis.percussion.search.select import (
    begin_search,
    run_search,
    start_from,
)
from picchio.diagnosis.percussion.search.state import LEAST_GAIN, Search, Trial
from picchio.diagnosis.percussion.tolerance.in_turns import refit_in_turns
from picchio.diagnosis.percussion.tolerance.linearise import (
    about_another,
    seek_the_silent,
    settled,
    to_the_last,
)
from picchio.diagnosis.result import Cause, Diagnosis, Estimate, Gain
from picchio.model.effects.effect import Effect
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.studies.tasks import Task

# A doubtful cause that explains more than this of what is wrong without it is not left out.
_NEEDED = 0.5


@dataclass(frozen=True, eq=False)
class PercussionDiagnosis:
    """A diagnosis with all that led to it, for reports and tests.

    Attributes:
        diagnosis: the answer.
        problem: data and noise.
        baseline: nuisances alone, fitted to all records.
        extended: with the causes, fitted to all records.
        search: the way there.
        before, after: tests of what the two leave.
        others: models with the alternative sets, in the order of the diagnosis's.
        left_open: how well all that a life depends on is known.
        stated: the extended model, what is not exact where it is stated.
    """

    diagnosis: Diagnosis
    problem: Problem
    baseline: Fit
    extended: Fit
    search: Search
    before: Evidence
    after: Evidence
    others: tuple[Hypothesis, ...] = ()
    left_open: Uncertain | None = None
    stated: Hypothesis | None = None

    def with_fit(self, whole: Fit, **changes: Any) -> PercussionDiagnosis:
        """The same with another extended model.

        Args:
            whole: fitted to all records.
            **changes: other attributes.

        Returns:
            what follows from the fit is that of the new one.
        """
        return replace(
            self,
            extended=whole,
            after=fit_evidence(self.problem, whole),
            left_open=fitted_spread(self.problem, whole),
            stated=as_stated(self.problem, whole),
            **changes,
        )

    @property
    def effects(self) -> tuple[Effect, ...]:
        """Of the extended model as studies and files have it."""
        return (self.stated or self.extended.hypothesis).effects

    def life(self, task: Task) -> dict[str, Any]:
        """A task's life before and after, with intervals, and with every alternative set.

        Args:
            task: whose life is wanted.

        Raises:
            InputError: as `picchio.diagnosis.life.life_before_and_after`.
        """
        # As the fit took gravity's stiffness, and as the saved model has it.
        assumed = self.problem.model.gravity_stiffness
        robot = replace(self.problem.robot, fitted_gravity=assumed)
        return life_before_and_after(
            robot,
            task,
            self.effects,
            before=nominal_spread(self.problem),
            after=self.left_open,
            others=[other.effects for other in self.others],
            causes=[(cause.effect, cause.target) for cause in self.diagnosis.causes],
            workers=self.problem.workers,
        )


# Numbers far off overflow in trials that are dropped for it: no warning to a user.
@np.errstate(over="ignore", invalid="ignore")
@one_thread()
def diagnose_percussion(
    robot: FlexibleRobot,
    campaign: Campaign,
    *,
    without: Iterable[str] = (),
    known: Sequence[Estimate] = (),
    gravity_stiffness: bool = True,
    workers: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> PercussionDiagnosis:
    """What the simulation of these percussion records gets wrong, and why.

    Args:
        robot: as its files have it.
        campaign: the records; motion records are left out.
        without: names of effects that must not be considered.
        known: causes that other records tell; the search starts from those that help here, too.
        gravity_stiffness: whether gravity's change with the deflection counts.
        workers: processes (Linux only); as many as cores where None. The result is the same.
        progress: told what is being done.

    Raises:
        InputError: records that can't be predicted for this robot.
    """
    say = progress or (lambda text: None)
    say("reading the records and their noise")
    problem = Problem(robot, campaign, gravity_stiffness=gravity_stiffness, workers=workers)
    candidates = all_candidates(problem, without)
    finer = finer_candidates(problem, without)
    warm_up(problem, candidates)
    with parallel_records(problem):
        return _concluded(*_searched(problem, candidates, finer, known, say))


def _searched(
    problem: Problem,
    candidates: Sequence[tuple[type[Effect], str]],
    finer: Sequence[tuple[type[Effect], str]],
    known: Sequence[Estimate],
    say: Callable[[str], None],
) -> tuple[Search, Fit, Evidence]:
    """The search of the usual records, or of others where those may hide what is wrong.

    Beside it the nuisances alone, fitted to all records, and what that leaves.
    """

    def searched(split: Split) -> Search:
        search = begin_search(problem, candidates, split, say, finer)
        start_from(search, known)
        start_far(search)
        run_search(search)
        return search

    first, *others = held_out(problem)
    search = searched(first)
    nominal, before = _nominal(search)
    if search.pinned and not search.labels and not before.is_noise:
        # Noise in the poses that were searched, and more in all: they hide what is wrong.
        say("searching other poses")
        found = [other for other in map(searched, others) if other.labels]
        search = max(found, key=lambda other: other.gained, default=search)
    return search, nominal, before


def _nominal(search: Search) -> tuple[Fit, Evidence]:
    problem, baseline = search.problem, search.baseline.hypothesis
    if not search.labels:
        nominal = refit(problem, search.best.hypothesis, problem.records)
        return nominal, fit_evidence(problem, nominal)
    with about_another(problem, search.about):
        nominal = fit(problem, baseline, problem.records, None, iterations=3)
        return nominal, fit_evidence(problem, nominal)


def _concluded(search: Search, nominal: Fit, before: Evidence) -> PercussionDiagnosis:
    """What may be said of what a search has found."""
    problem = search.problem
    every = _told_by_slopes(search)
    whole, after = _fitted_to_all(search, nominal, every)
    same: list[Trial] = []
    rivals = _rivals(search, whole)
    causes = fitted_causes(search, whole, rivals)
    dropped: list[tuple[str, str]] = []
    while len(causes) > 1 and (doubted := doubtful(causes)):
        # What is not beyond doubt is none beside what is: it is told as a lead.
        rest = attempt("without what is doubted", partial(_without, search, doubted[0]))
        # A set that explains little without it stands or falls as a whole.
        if rest is None or explained_share(search.best, rest) > _NEEDED:
            break
        dropped.append((doubted[0].effect, doubted[0].target))
        search.best = rest
        whole = refit_in_turns(problem, rest.hypothesis, every)
        after = fit_evidence(problem, whole)
        rivals = _rivals(search, whole)
        causes = fitted_causes(search, whole, rivals)
    gain = _held_out(search)
    if causes and _are_idle(problem, gain, (nominal, before), (whole, after)):
        search.best, causes, rivals = search.baseline, (), []
        search.about.restore(problem)
        whole, gain = nominal, _held_out(search)
    # Judged with the slopes that it was fitted with: those of all records may lie elsewhere.
    stands, judged = search.best.hypothesis, search.kept or search.records
    remainder = held_out_remainder(problem, stands, judged)
    if allowed(problem):
        whole = to_the_last(problem, whole)
        after = fit_evidence(problem, whole)
    off = exceeded(problem, whole)
    left_open, stated = fitted_spread(problem, whole), as_stated(problem, whole)
    beyond = off is not None and off.improbable
    left = None
    if allowed(problem):
        left = Remainder.of(nominal, before), Remainder.of(whole, after)
    # More rivals can only lessen the confidence: what isn't sure by now won't be claimed.
    if causes and (leaves_little(after, left) or may_be_partial(causes, gain.explained, left)):
        search.say("looking for other causes that would do as well")
        same, rivals, causes = weighed(search, whole)
    common = common_faults(whole.hypothesis, reported_covariance(whole), problem.groups)
    verdict = verdict_of(causes, before, after, bool(same), gain.explained, common, left, beyond)
    if verdict == "nothing-wrong" and (
        beyond or not (before.is_noise or remainder.within_tolerance)
    ):
        verdict = (
            "unexplained"  # tolerances alone are not so far off, or held-out records have more
        )
    if any(e.latent and e.latent.linear for e in whole.hypothesis.effects):
        causes = with_solved(causes, with_solved_numbers(problem, whole))
    others: dict[tuple[tuple[str, str], ...], Hypothesis] = {}
    for t in same:
        pairs = tuple(sorted(pair_of(label) for label in t.fit.hypothesis.labels))
        others.setdefault(pairs, t.fit.hypothesis)
    little = leaves_little(after, left)
    note = why_not_claimed(causes, common, beyond) if little and verdict == "unexplained" else ""
    if verdict == "unexplained" and not causes and beyond and off is not None:
        note = off.told()
    leads: tuple[tuple[str, str], ...] = ()
    if note:
        leads = tuple((c.effect, c.target) for c in causes)
    elif verdict == "unexplained":
        leads = tuple(_leads(search))
    elif claimed_of(verdict):
        leads = tuple(dropped)
    if verdict == "unexplained" and not note and after.overstated:
        note = not_quiet(after.overstated)
    ask = None
    if verdict in ("ambiguous", "unexplained", "partial") and not common:
        search.say("looking for the measurement that would tell most")
        looked = partial(next_measurement, problem, whole, rivals, same)
        ask = attempt("next measurement", looked)
    claimed = claimed_of(verdict)
    diagnosis = Diagnosis(
        verdict=verdict,
        causes=causes if claimed else (),
        alternatives=tuple(others) if claimed else (),
        leads=leads,
        nuisances=fitted_nuisances(whole if claimed or verdict == "nothing-wrong" else nominal),
        gain=gain,
        next_measurement=ask,
        scores=tuple(_scores(search)),
        note=note,
        remainder=remainder,
        untold=tuple(r.name for r in problem.records if r not in every),
    )
    return PercussionDiagnosis(
        diagnosis, problem, nominal, whole, search, before, after,
        tuple(others.values()) if claimed else (), left_open, stated,
    )  # fmt: skip


def _held_out(search: Search) -> Gain:
    """On the records held out, without causes and with those that were found."""
    without, found = search.baseline.hypothesis, search.best.hypothesis
    about = search.about
    return holdout_gain(search.problem, without, found, search.records, search.kept, about)


def _are_idle(
    problem: Problem, gain: Gain, without: tuple[Fit, Evidence], found: tuple[Fit, Evidence]
) -> bool:
    """Whether the nominal model leaves little, and causes explain little of that held out.

    They could not be claimed even in part, and an honest model may leave what they lessen.
    """
    if not allowed(problem) or gain.explained is None:
        return False
    left = Remainder.of(*without), Remainder.of(*found)
    enough = 0.0 if leaves_little(found[1], left) else LEAST_EXPLAINED
    return left[0].within_tolerance and gain.explained <= enough


def _rivals(search: Search, whole: Fit) -> list[Trial]:
    """Other first causes that were fitted to the end."""
    first = search.steps[0] if search.steps else []
    return [
        t
        for t in first
        if t.finished(search.records) and t.fit.hypothesis.labels != whole.hypothesis.labels
    ]


def _without(search: Search, cause: Cause) -> Fit:
    """The best fit without one of its causes, fitted again."""
    rest = search.best.hypothesis.minus(f"{cause.effect}:{cause.target}")
    return settled(search.problem, search.fit(rest, iterations=5), search.records, rounds=1)


def _told_by_slopes(search: Search) -> list[MeasuredRecord]:
    """All records but those in which small errors grow beyond what slopes can say.

    Nothing that is common to all is known from those. That their own numbers alone leave little of
    them speaks for what was found; where they do not, they count against it.
    """
    problem = search.problem
    with about_another(problem):
        told = seek_the_silent(problem, search.best.hypothesis)
    return [record for record in problem.records if record not in told]


def _fitted_to_all(
    search: Search, nominal: Fit, every: Sequence[MeasuredRecord]
) -> tuple[Fit, Evidence]:
    """What was found, fitted to all records; where more than noise is left, what dominates."""
    problem = search.problem
    if not search.labels:
        return nominal, fit_evidence(problem, nominal)
    search.say("fitting what was found to all records")
    whole = refit_in_turns(problem, search.best.hypothesis, every)
    after = fit_evidence(problem, whole)
    if len(search.labels) > 1 and not after.is_noise:
        search.say("checking which causes dominate the residual")
        stands = dominant_causes(problem, search.best)
        if stands is not search.best:
            search.best = stands
            whole = refit_in_turns(problem, stands.hypothesis, every)
            after = fit_evidence(problem, whole)
    return whole, after


def _leads(search: Search) -> list[tuple[str, str]]:
    """What helped, though nothing may be claimed."""
    if not search.steps:
        return []
    reference = bic(search.baseline)
    helpful = [t for t in search.steps[0] if reference - t.score > LEAST_GAIN]
    return [pair_of(t.label) for t in helpful[:3]]


def _scores(search: Search) -> list[dict[str, object]]:
    rows = []
    for number, step in enumerate(search.steps):
        for trial in step:
            name, target = pair_of(trial.label)
            rows.append(
                {
                    "step": number + 1,
                    "effect": name,
                    "target": target,
                    "bic": trial.score,
                    "screened_gain": trial.promise,
                    "chi_square_per_sample": trial.fit.chi_square / max(trial.fit.samples, 1),
                }
            )
    return rows
