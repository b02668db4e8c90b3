"""Greedy choice of causes: a round of trials after the other; held-out poses must confirm."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from typing import Any

from picchio.diagnosis.percussion.criteria.bic import SAME, bic
from picchio.diagnosis.percussion.criteria.confidence import confidence
from picchio.diagnosis.percussion.criteria.equivalence import bic_difference
from picchio.diagnosis.percussion.criteria.whiteness import Evidence, whiteness_test
from picchio.diagnosis.percussion.data.problem import Problem, signal_power
from picchio.diagnosis.percussion.data.record import MeasuredRecord
from picchio.diagnosis.percussion.fit.drawn import LATENT, fit_latent
from picchio.diagnosis.percussion.fit.least_squares import Fit, fit
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.search.exchange import (
    Tried,
    exchange,
    prune,
    replaced,
    rivals_of,
    with_latent,
)
from picchio.diagnosis.percussion.search.restart import restarted
from picchio.diagnosis.percussion.search.trials import (
    MOST_RIVALS,
    Trial,
    holdout_choice,
    over_the_same_samples,
    try_candidates,
)
from picchio.diagnosis.result import BEYOND_DOUBT
from picchio.model.effects.effect import Effect
from picchio.model.effects.registry import effect_class
from picchio.model.effects.scales import Scales

MOST_CAUSES = 3
# Fall of BIC below which nothing is claimed: with a hundred candidates tried, chance alone
# reaches it in less than one of a thousand campaigns.
LEAST_GAIN = 8.0
# The forward model itself is exact to about this share of the signal (sensors smear jumps, second
# order in the deflection): what gains less than that is no cause.
EXACT = 3e-4
# Of the least gain: beyond that no fit without the cause comes near.
_CLEAR = 10.0
# How often every cause is replaced in turn, and up to what share of the baseline's cost that is
# worth while.
_SWEEPS = 2
_HALFWAY = 0.3


@dataclass(eq=False)
class Search:
    """What the search for causes has found.

    Attributes:
        baseline: nuisances alone, on the records for fitting.
        best: the hypothesis that stands at the end.
        steps: per step the trials, the best first.
        evidence: on all records used for fitting.
        pinned: whether noise was all that was left, and what is known is held fixed since.
        replacements: what was tried in place of a cause.
    """

    baseline: Fit
    best: Fit
    steps: list[list[Trial]] = field(default_factory=list)
    scores: list[dict[str, Any]] = field(default_factory=list)
    evidence: Evidence | None = None
    pinned: bool = False
    replacements: Tried = field(default_factory=dict)


def search(
    problem: Problem,
    candidates: Sequence[tuple[type[Effect], str]],
    scales: Scales,
    records: Sequence[MeasuredRecord],
    baseline: Fit,
    held_out_gain: Callable[[Fit, Fit], float | None] = lambda before, after: None,
    *,
    progress: Callable[[str], None] | None = None,
) -> Search:
    """Add causes one by one while they pay.

    Args:
        problem: data and noise.
        candidates: effects and targets.
        scales: sizes that matter.
        records: to fit; others are held out.
        baseline: the nuisances' fit to them.
        held_out_gain: (before, after) -> fall of chi-square in the records held out; None where
            they can't tell.
        progress: told what is being done.
    """
    say = progress or (lambda text: None)
    found = Search(baseline, baseline)
    least = max(LEAST_GAIN, EXACT**2 * signal_power(records))

    def confirmed(before: Fit, after: Fit) -> bool:
        gain = held_out_gain(before, after)
        return gain is None or gain > 0.0

    def accepted(other: Fit) -> Fit:
        return other if other is found.best or confirmed(found.best, other) else found.best

    def grow(stack: ExitStack) -> None:
        for _ in range(MOST_CAUSES):
            here = found.best
            found.evidence = whiteness_test(problem, here.residuals, here.records)
            say(f"looking for cause {len(here.hypothesis.labels) + 1}")
            quiet = found.evidence.is_noise
            if quiet and not found.pinned:
                stack.enter_context(problem.pinned(here.hypothesis.effects))
                found.pinned = True
            trials = try_candidates(
                problem, here.hypothesis, candidates, scales, records,
                whole=quiet, least=least, log=found.scores.append,
            )  # fmt: skip
            if not trials:
                break
            if not found.pinned:
                trials = over_the_same_samples(problem, trials, records)
            found.steps.append(trials)
            tied = [t for t in trials if t.score - trials[0].score < SAME]
            best = holdout_choice([(t, held_out_gain(here, t.fit)) for t in tied])
            if best is None and not quiet:
                # What looked best is none; the right one may not have been among those fitted.
                wider = try_candidates(
                    problem, here.hypothesis, candidates, scales, records,
                    wide=True, least=least, log=found.scores.append,
                )  # fmt: skip
                trials[:] = wider or trials
                held = (t for t in trials if t.finished(records) and confirmed(here, t.fit))
                best = next(held, None)
            gain = bic(here) - best.score if best is not None else 0.0
            if best is None or gain < least:
                break
            trials.sort(key=lambda t: t is not best)
            # What the model itself is not exact to may look like a last small cause in some pose.
            known = bool(here.hypothesis.labels)
            if quiet and known and confidence(best.fit, here) < BEYOND_DOUBT:
                break
            found.best = prune(problem, best.fit, records, least, alone=gain <= _CLEAR * least)
            if known and not quiet:
                found.best = _calm(problem, found.best, best.label, records)
            if found.best.hypothesis.labels == here.hypothesis.labels:
                if found.best.cost < here.cost and not quiet:
                    continue
                break
            found.best = restarted(problem, found.best, scales, records)
            # Times of blows may have been missed: then they are looked for once more.
            if known:
                noise = whiteness_test(problem, found.best.residuals, found.best.records).is_noise
                again = with_latent(problem, found.best, best.label if noise else "")
                if again.cost < found.best.cost:
                    found.best = prune(problem, again, records, least, alone=False)
            if (
                known
                and not whiteness_test(problem, found.best.residuals, found.best.records).is_noise
            ):
                other = exchange(problem, found.best, found.steps, records, least)
                if other is not found.best:  # beside the right one, others may have nothing to do
                    other = prune(problem, other, records, least, alone=False)
                found.best = accepted(other)
            if len(found.best.hypothesis.labels) >= MOST_CAUSES:
                break

    with ExitStack() as stack:
        grow(stack)
        for _ in range(_SWEEPS):
            best = found.best
            several = len(best.hypothesis.labels) > 1
            if not several or best.cost > _HALFWAY * baseline.cost:
                break
            if whiteness_test(problem, best.residuals, best.records).is_noise:
                break
            say("looking whether the causes chosen first were the right ones")
            settled = {label for label in best.hypothesis.labels if _tried_before(found, label)}
            other = replaced(
                problem, best, candidates, scales, records, least, found.replacements, settled
            )
            found.best = accepted(other)
            if found.best is best:
                break
            if len(found.best.hypothesis.labels) < MOST_CAUSES:
                grow(stack)
    found.evidence = whiteness_test(problem, found.best.residuals, found.best.records)
    return found


def _calm(problem: Problem, best: Fit, newest: str, records: Sequence[MeasuredRecord]) -> Fit:
    """The fit without its newest cause, where that leaves noise, too.

    Then the others had stopped short of their best, and the newest only moved them on: whether it
    is there is asked once more, with what counts as known held fixed.
    """
    if newest not in best.hypothesis.labels or len(best.hypothesis.labels) < 2:
        return best
    without = fit(problem, best.hypothesis.minus(newest), records, None, iterations=5)
    return without if whiteness_test(problem, without.residuals, records).is_noise else best


def alternatives(
    problem: Problem,
    found: Search,
    candidates: Sequence[tuple[type[Effect], str]],
    scales: Scales,
    records: Sequence[MeasuredRecord],
) -> tuple[list[Trial], list[Trial]]:
    """Other sets of causes that explain as much: each cause replaced by every other suspect.

    Returns:
        those within `SAME`, and all that were fitted to the end.
    """
    best = found.best
    same: list[Trial] = []
    tried: list[Trial] = []
    for cause in best.hypothesis.causes:
        trials = _tried_before(found, cause.label) or rivals_of(
            cause.label, problem, best, candidates, scales, records, found.replacements, MOST_RIVALS
        )
        finished = [t for t in trials if t.finished(records)]
        tried += finished
        for trial in finished:
            if trial.fit.hypothesis.labels == best.hypothesis.labels:
                continue
            if bic_difference(problem, best, trial.fit, records) < SAME:
                same.append(trial)
    return same, tried


def _tried_before(found: Search, label: str) -> list[Trial]:
    """What was tried beside the other causes alone, which is what was known in some step."""
    others = found.best.hypothesis.labels - {label}
    for step in reversed(found.steps):
        if step[0].fit.hypothesis.labels - {step[0].label} == others:
            return [t for t in step if t.label != label]
    return []


def refit(problem: Problem, hypothesis: Hypothesis, records: Sequence[MeasuredRecord]) -> Fit:
    """A hypothesis refitted to some records, from where it stands, with its Jacobian."""
    hidden = [e.name for e in hypothesis.effects if e.name in LATENT and e.name != "mains_hum"]
    # Blows' times in records that were held out are not known yet: nothing can be fitted to them.
    turns = 0 if "pulse_jitter" in hidden else 4
    found = fit(problem, hypothesis, records, None, iterations=turns, with_jacobian=not hidden)
    for name in hidden:
        found = fit_latent(problem, found, effect_class(name), "tool")
    for effect in hypothesis.effects:
        if effect.name == "mains_hum":  # its lines are another number in more records
            found = fit_latent(problem, found, type(effect), effect.target)
    if hidden:
        found = fit(problem, found.hypothesis, records, None, iterations=1, with_jacobian=True)
    return replace(found)
