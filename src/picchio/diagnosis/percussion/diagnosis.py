"""From percussion records to a verdict."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from picchio.campaign.campaign import Campaign
from picchio.core.arrays import FloatArray
from picchio.diagnosis.life import life_before_and_after
from picchio.diagnosis.percussion.conclude.causes import (
    fitted_causes,
    fitted_nuisances,
    fitted_spread,
    nominal_spread,
    reported_covariance,
    with_hum,
)
from picchio.diagnosis.percussion.conclude.holdout import holdout_gain
from picchio.diagnosis.percussion.conclude.verdict import (
    may_be_partial,
    pair_of,
    verdict_of,
    why_not_claimed,
)
from picchio.diagnosis.percussion.criteria.bic import SAME, bic
from picchio.diagnosis.percussion.criteria.common_fault import common_faults
from picchio.diagnosis.percussion.criteria.dominance import dominant_causes
from picchio.diagnosis.percussion.criteria.equivalence import bic_difference
from picchio.diagnosis.percussion.criteria.whiteness import Evidence
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.data.record import MeasuredRecord
from picchio.diagnosis.percussion.data.split import held_out
from picchio.diagnosis.percussion.fit.drawn import hum_lines
from picchio.diagnosis.percussion.fit.least_squares import Fit
from picchio.diagnosis.percussion.fit.parallel_records import parallel_records
from picchio.diagnosis.percussion.fit.unknowns import TOLERATED, Hypothesis
from picchio.diagnosis.percussion.follow_up.next_measurement import next_measurement
from picchio.diagnosis.percussion.search.candidates import all_candidates
from picchio.diagnosis.percussion.search.rounds import fit_evidence, look
from picchio.diagnosis.percussion.search.select import LEAST_GAIN, Search, alternatives, refit
from picchio.diagnosis.percussion.search.trials import Trial
from picchio.diagnosis.percussion.search.warm_up import warm_up
from picchio.diagnosis.result import Diagnosis
from picchio.measurement.noise.level import Noise
from picchio.model.effects.effect import Effect
from picchio.model.effects.scales import Scales
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.studies.tasks import Task


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
        scales: sizes in this campaign.
        others: models with the alternative sets, in the order of the diagnosis's.
    """

    diagnosis: Diagnosis
    problem: Problem
    baseline: Fit
    extended: Fit
    search: Search
    before: Evidence
    after: Evidence
    scales: Scales
    others: tuple[Hypothesis, ...] = ()

    def life(self, task: Task) -> dict[str, Any]:
        """A task's life before and after, with intervals, and with every alternative set.

        Raises:
            InputError: as `picchio.diagnosis.life.life_before_and_after`.
        """
        robot = self.problem.robot
        return life_before_and_after(
            robot,
            task,
            self.extended.hypothesis.effects,
            before=nominal_spread(robot, self.problem.campaign.tolerance),
            after=fitted_spread(self.extended),
            others=[other.effects for other in self.others],
        )


def diagnose_percussion(
    robot: FlexibleRobot,
    campaign: Campaign,
    *,
    without: Iterable[str] = (),
    noise: Mapping[str, Noise] | None = None,
    gravity_stiffness: bool = True,
    workers: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> PercussionDiagnosis:
    """What the simulation of these percussion records gets wrong, and why.

    Args:
        robot: as its files have it.
        campaign: the records; motion records are left out.
        without: names of effects that must not be considered.
        noise: channel -> noise; estimated where None.
        gravity_stiffness: whether gravity's change with the deflection counts.
        workers: processes (Linux only); as many as cores where None. The result is the same.
        progress: told what is being done.

    Raises:
        InputError: records that can't be predicted for this robot.
    """
    say = progress or (lambda text: None)
    say("reading the records and their noise")
    problem = Problem(robot, campaign, noise, gravity_stiffness=gravity_stiffness, workers=workers)
    candidates = all_candidates(problem, without)
    warm_up(problem, candidates)
    with parallel_records(problem):
        return _diagnosed(problem, candidates, say)


def _diagnosed(
    problem: Problem,
    candidates: Sequence[tuple[type[Effect], str]],
    say: Callable[[str], None],
) -> PercussionDiagnosis:
    ways = held_out(problem)
    looked = look(problem, candidates, ways[0], say)
    nominal, before = looked.nominal(problem)
    if looked.found.pinned and not looked.found.best.hypothesis.labels and not before.is_noise:
        # Noise in the poses that were looked at, and more in all: they hide what is wrong.
        say("looking at other poses")
        again = [look(problem, candidates, way, say) for way in ways[1:]]
        told = [other for other in again if other.found.best.hypothesis.labels]
        looked = max(told, key=lambda other: other.gained, default=looked)
    found, train, kept = looked.found, looked.train, looked.kept
    baseline, scales = looked.baseline, looked.scales
    say("fitting what was found to all records")
    whole = nominal
    if found.best.hypothesis.labels:
        whole = refit(problem, found.best.hypothesis, problem.records)
    after = fit_evidence(problem, whole)
    if len(found.best.hypothesis.labels) > 1 and not after.is_noise:
        say("looking which of the causes stand far above what is left")
        stands = dominant_causes(problem, found.best, train)
        if stands is not found.best:
            found.best = stands
            whole = refit(problem, stands.hypothesis, problem.records)
            after = fit_evidence(problem, whole)
    gain = holdout_gain(problem, baseline.hypothesis, found.best.hypothesis, train, kept)
    same: list[Trial] = []
    rivals = [
        t
        for t in (found.steps[0] if found.steps else [])
        if t.finished(train) and t.fit.hypothesis.labels != whole.hypothesis.labels
    ]
    causes = fitted_causes(problem, whole, found, rivals, train)
    # More rivals can only lessen the confidence: what isn't sure by now won't be claimed.
    if causes and (after.is_noise or may_be_partial(causes, gain.explained)):
        say("looking for other causes that would do as well")
        # Over the same samples: else a rival may lose, or win, by which of them it knows.
        with problem.pinned(found.best.hypothesis.effects):
            same, rivals = alternatives(problem, found, candidates, scales, train)
        with problem.pinned(whole.hypothesis.effects):
            same, refuted = _on_all_records(problem, whole, same)
        causes = fitted_causes(problem, whole, found, rivals, train, refuted)
    common = common_faults(whole.hypothesis, reported_covariance(whole), problem.groups)
    verdict = verdict_of(causes, before, after, bool(same), gain.explained, common)
    if any(e.name == "mains_hum" for e in whole.hypothesis.effects):
        causes = with_hum(causes, hum_lines(problem, whole))
    others: dict[tuple[tuple[str, str], ...], Hypothesis] = {}
    for t in same:
        pairs = tuple(sorted(pair_of(label) for label in t.fit.hypothesis.labels))
        others.setdefault(pairs, t.fit.hypothesis)
    note = why_not_claimed(causes, common) if after.is_noise and verdict == "unexplained" else ""
    leads: tuple[tuple[str, str], ...] = ()
    if note:
        leads = tuple((c.effect, c.target) for c in causes)
    elif verdict == "unexplained":
        leads = tuple(_leads(found))
    ask = None
    if verdict in ("ambiguous", "unexplained", "partial") and not common:
        say("looking for the measurement that would tell most")
        ask = next_measurement(problem, whole, rivals, same)
    claimed = verdict in ("named", "ambiguous", "partial")
    diagnosis = Diagnosis(
        verdict=verdict,
        causes=causes if claimed else (),
        alternatives=tuple(others) if claimed else (),
        leads=leads,
        nuisances=fitted_nuisances(whole if claimed or verdict == "nothing-wrong" else nominal),
        gain=gain,
        next_measurement=ask,
        scores=tuple(_scores(found)),
        note=note,
    )
    return PercussionDiagnosis(
        diagnosis, problem, nominal, whole, found, before, after, scales,
        tuple(others.values()) if claimed else (),
    )  # fmt: skip


def _on_all_records(
    problem: Problem, whole: Fit, same: Sequence[Trial]
) -> tuple[list[Trial], list[Trial]]:
    """Rivals that do as well on all records, those held out included; and those that don't."""
    kept: list[Trial] = []
    refuted: list[Trial] = []
    for trial in same:
        there = refit(problem, trial.fit.hypothesis, problem.records)
        alike = bic_difference(problem, whole, there, problem.records) < SAME
        (kept if alike else refuted).append(replace(trial, fit=there, score=bic(there)))
    return kept, refuted


def _leads(found: Search) -> list[tuple[str, str]]:
    """What helped, though nothing may be claimed."""
    if not found.steps:
        return []
    reference = bic(found.baseline)
    helpful = [t for t in found.steps[0] if reference - t.score > LEAST_GAIN]
    return [pair_of(t.label) for t in helpful[:3]]


def _scores(found: Search) -> list[dict[str, object]]:
    rows = []
    for number, step in enumerate(found.steps):
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


def within_tolerance(value: float, sigma: float) -> bool:
    """Whether a relative difference is a nuisance, not a cause."""
    return abs(value) <= TOLERATED * sigma


def signal(problem: Problem, records: Sequence[MeasuredRecord]) -> list[FloatArray]:
    """The measured channels in units of their noise, (channels, m) a record."""
    return [np.stack([v / r.noise[name].std for name, v in r.values.items()]) for r in records]
