"""Greedy choice of causes: a round of trials after the other; held-out poses must confirm."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial

from picchio.diagnosis.attempt import attempt
from picchio.diagnosis.percussion.criteria.equivalence import (
    SAME,
    bic,
    bic_difference,
    confidence,
)
from picchio.diagnosis.percussion.criteria.remainder import allowed, decisive_gain
from picchio.diagnosis.percussion.data.problem import MeasuredRecord, Problem, Split
from picchio.diagnosis.percussion.fit.least_squares import Fit, fit_growing
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.search.alike import (
    exceeding_trials,
    settled_alike,
    settled_by_itself,
)
from picchio.diagnosis.percussion.search.candidates import measure_scales
from picchio.diagnosis.percussion.search.exchange import (
    exchange,
    exchange_settled,
    in_an_earlier_place,
    prune,
    refit_latent,
    replace_causes,
    rivals_of,
)
from picchio.diagnosis.percussion.search.refine import coarsened, refined
from picchio.diagnosis.percussion.search.restart import restarted
from picchio.diagnosis.percussion.search.state import LEAST_GAIN, Search, Trial
from picchio.diagnosis.percussion.search.trials import (
    MOST_RIVALS,
    holdout_choice,
    over_the_same_samples,
    try_candidates,
)
from picchio.diagnosis.percussion.tolerance.in_turns import settled_in_turns
from picchio.diagnosis.percussion.tolerance.linearise import (
    ELSE,
    About,
    about_another,
    left_there,
    released,
    settled,
    to_the_last,
)
from picchio.diagnosis.result import BEYOND_DOUBT, Estimate
from picchio.model.effects.effect import Effect

MOST_CAUSES = 3
# Of the least gain: beyond that no fit without the cause comes near.
_CLEAR = 10.0
# How many times what its slopes promised a cause explains where something else made up for it.
_FORETOLD = 2.0
# How often every cause is replaced in turn, and up to what share of the baseline's cost that is
# worth while.
_SWEEPS = 2
_HALFWAY = 0.3
# How often springs that were identified are settled further, at most.
_MORE_ROUNDS = 6
# What share of the cost a turn must take for going on from far off to be worth while.
_FALLING = 0.3
# How many times what its slopes foretell a model may leave, and to what share of that settling it
# must lead.
_UNFORETOLD = 1.1
_NEARER = 0.5


def begin_search(
    problem: Problem,
    candidates: Sequence[tuple[type[Effect], str]],
    split: Split,
    say: Callable[[str], None] = lambda text: None,
    finer: Sequence[tuple[type[Effect], str]] = (),
) -> Search:
    """A search that has the nominal model fitted within its tolerance.

    Args:
        problem: data and noise.
        candidates: effects and targets.
        split: records to fit, and records held out.
        say: told what is being done.
        finer: effects and targets that tell another cause with more numbers.
    """
    say("fitting the nominal model within its tolerance")
    start = Hypothesis.nominal(problem)
    begin = fit_growing(problem, start, split[0])
    baseline = settled(problem, begin, split[0])
    if start.known.labels and baseline.chi_square > ELSE * baseline.samples:
        # Springs that were identified: rather masses and places are farther off than slopes reach.
        before = About.of(problem)
        other = settled(problem, begin, split[0], patient=True)
        other = _settled_on(problem, other, _FALLING)
        if other.chi_square <= ELSE * other.samples:
            baseline = other
        else:
            before.restore(problem)
    if start.known.labels:
        baseline = _settled_on(problem, baseline)
    effects = baseline.hypothesis.effects
    scales = measure_scales(problem, effects, problem.predictions(effects))
    return Search(problem, candidates, scales, *split, baseline, baseline, say, finer)


def _settled_on(problem: Problem, found: Fit, share: float = 0.0) -> Fit:
    """A fit with springs that may start far away: linearised anew while that is worth while.

    While it takes more than `share` of what the fit costs, or else until it moves no further.
    """
    for _ in range(_MORE_ROUNDS):
        before, found = found, _settled_further(problem, found, found.records, patient=True)
        if before.cost - found.cost < max(LEAST_GAIN, share * before.cost):
            break
    return found


def _settled_further(
    problem: Problem, found: Fit, records: Sequence[MeasuredRecord], *, patient: bool = False
) -> Fit:
    """A fit settled from where its inexact numbers are now; itself, where that is no better."""
    go_on = partial(settled, problem, found, records, rounds=2, anew=False, patient=patient)
    with about_another(problem):
        again = attempt("settled further", go_on)
        about = About.of(problem)
    if again is None or again.cost >= found.cost:
        return found
    about.restore(problem)
    return again


def start_from(search: Search, known: Sequence[Estimate]) -> None:
    """Take over causes that other records tell, as far as they help in these, too."""
    for cause in known:
        if cause.effect.label in search.considered:
            informed = search.best.hypothesis.informed(cause.effect, cause.std)
            there = attempt(cause.effect.label, partial(search.fit, informed, iterations=6))
            if there is not None and there.cost < search.best.cost - search.least:
                search.best = there


def run_search(search: Search) -> None:
    """Add causes one by one while they pay, and replace those that were chosen too early."""
    with ExitStack() as stack:
        _grow(search, stack)
        for _ in range(_SWEEPS):
            best = search.best
            several = len(search.labels) > 1
            if not several or best.cost > _HALFWAY * search.baseline.cost:
                break
            if search.leaves_noise(best):
                break
            search.say("checking whether the causes chosen first were the right ones")
            settled = {label for label in search.labels if _tried_before(search, label)}
            other, about = replace_causes(search, settled)
            _accept(search, other, about)
            if search.best is best:
                break
            if len(search.labels) < MOST_CAUSES:
                _grow(search, stack)


def _accept(search: Search, other: Fit, about: About | None = None) -> None:
    """Take a fit in place of the best, if the records held out do not speak against it."""
    if other is not search.best and search.confirmed(other, about):
        search.best = other
        if about is not None:
            about.restore(search.problem)


def _grow(search: Search, stack: ExitStack) -> None:
    """Add causes until nothing pays, noise is left, or there are too many."""
    problem = search.problem
    for _ in range(MOST_CAUSES):
        here = search.best
        search.stood[search.labels] = here, About.of(problem)
        # What is left may be a remainder, or a cause that is small beside those that are known.
        enough = search.explains_enough(here)
        search.say(f"looking for cause {len(search.labels) + 1}")
        quiet = search.leaves_noise(here)
        if quiet and search.labels:
            here = _settled_to_the_last(search)
            quiet = search.leaves_noise(here)
        if quiet and not search.pinned:
            stack.enter_context(problem.pinned(here.hypothesis.effects))
            search.pinned = True
        looked = partial(try_candidates, search, here.hypothesis, whole=quiet)
        trials = attempt("candidates", looked)
        if not trials:
            break
        if not search.pinned:
            trials = over_the_same_samples(search, trials)
        trials = refined(search, settled_alike(search, coarsened(search, trials)))
        search.steps.append(trials)
        best = _chosen(search, trials, wider=not quiet)
        gain = search.pays(here, best.fit, best.about) if best is not None else 0.0
        if best is not None and best.about is not None and gain <= _CLEAR * search.least:
            here = _settled_again(search)
            search.stood[search.labels] = here, About.of(problem)
            gain = search.pays(here, best.fit, best.about)
        if best is not None and gain >= search.least and quiet and _made_up_for(search, best):
            best = _of_all(search, trials, best)
            gain = search.pays(here, best.fit, best.about)
        if best is not None and gain < search.least:
            best = _of_another_kind(search, best)
            gain = search.pays(here, best.fit, best.about)
        if best is None or gain < search.least:
            break
        trials[:] = [best, *(t.put_by() for t in trials if t.label != best.label)]
        # What the model itself is not exact to may look like a last small cause in some pose.
        known = bool(here.hypothesis.labels)
        if (quiet or enough) and known and confidence(best.fit, here) < BEYOND_DOUBT:
            # Yet it may be what an earlier one only stood for.
            if (found := in_an_earlier_place(search, best)) is not None:
                search.best, about = found
                about.restore(problem)
            break
        # A remainder that is allowed needs no cause that explains but a part of it.
        if enough and not search.leaves_noise(best.fit):
            break
        search.best = prune(search, best.fit, alone=gain <= _CLEAR * search.least)
        if known and not quiet:
            search.best = _without_newest(search, best.label)
        if search.labels == here.hypothesis.labels:
            if search.best.cost < here.cost and not quiet:
                continue
            break
        own = best.about if search.best is best.fit else None
        if own is not None:
            own.restore(problem)
        search.best = _without_earlier(search, best.label)
        again = restarted(search, search.best)
        if own is None or again is not search.best:
            again = _settled_if_better(search, again)
        search.best = released(problem, settled_in_turns(problem, again), search.least)
        if known:
            _settle(search, best.label)
        if len(search.labels) >= MOST_CAUSES:
            break


def _made_up_for(search: Search, best: Trial) -> bool:
    """Whether what is not exact had made up for a cause: it explains far more than it promised."""
    gain = search.best.cost - best.fit.cost
    return allowed(search.problem) and gain > _FORETOLD * best.promise


def _of_all(search: Search, trials: list[Trial], best: Trial) -> Trial:
    """The best of all candidates, once one pays that what is not exact had made up for.

    What slopes promise of such a cause says little of which it is: those that promised less are
    tried as well, and come to `trials`.
    """
    here, known = search.best, {trial.label for trial in trials}
    looked = partial(try_candidates, search, here.hypothesis, whole=True, wide=True)
    more = [t for t in attempt("all candidates", looked) or () if t.label not in known]
    more = [t for t in more if t.finished(search.records)]
    trials += settled_alike(search, more, best.fit, here)
    trials.sort(key=lambda t: t.score)
    return _chosen(search, trials, wider=False) or best


def _of_another_kind(search: Search, best: Trial) -> Trial:
    """A trial that does not pay, with another whole number where one does better.

    That of a filter's order is chosen beside numbers as they are stated, which may suit another.
    """
    (cause,) = (e for e in best.fit.hypothesis.causes if e.label == best.label)
    if not allowed(search.problem) or not any(p.whole for p in cause.parameters):
        return best
    with about_another(search.problem, best.about):
        again = restarted(search, best.fit)
        about = About.of(search.problem)
    if again is best.fit:
        return best
    return replace(best, fit=again, score=bic(again), about=about, in_vain=False)


def _without_earlier(search: Search, newest: str) -> Fit:
    """The fit without an earlier cause, where that does as well about its own inexact numbers.

    That one may have been chosen in the newest's place. What is not exact is off as suits both,
    so that none can be done without; about its own, the right one leaves no more alone.
    """
    best, problem = search.best, search.problem
    if not allowed(problem) or newest not in search.labels:
        return best
    for label in sorted(search.labels - {newest}):
        rest = best.hypothesis.minus(label)
        without = attempt(f"without {label}", partial(search.fit, rest, iterations=5))
        if without is None or without.chi_square > ELSE * without.samples:
            continue
        if bic(without) - bic(best) < search.least:
            best = without  # as it is: settled it could but leave less
            continue
        start = replace(best, hypothesis=rest)  # as the other's numbers are, which are near
        again, about = settled_by_itself(search, label, start, anew=False)
        if again is None:
            continue
        before = About.of(problem)
        with about_another(problem, about):
            gain = search.pays(again, best, before)
        if gain < search.least:
            about.restore(problem)
            best = again
    return best


def _settled_if_better(search: Search, found: Fit) -> Fit:
    """A fit about its own inexact numbers; as it was, where it did not find back there."""
    before = About.of(search.problem)
    again = settled(search.problem, found, search.records, rounds=2)
    if again.cost <= found.cost:
        return again
    before.restore(search.problem)
    return found


def _settled_again(search: Search) -> Fit:
    """The fit that stands, settled further, as what would take its place has been.

    Else what looks like a small cause may be no more than a round that it had more.
    """
    here = search.best
    again = _settled_further(search.problem, here, search.records)
    if search.baseline is here and again is not here:
        search.baseline, search.about = again, About.of(search.problem)
    search.best = again
    return again


def _settled_to_the_last(search: Search) -> Fit:
    """The fit that stands, settled where slopes foretell noise of a model that leaves much more.

    Beside causes alone: before there is one, what is not exact would make up for it. And where that
    comes nearer: numbers that are held at the farthest leave as much as before.
    """
    here, problem = search.best, search.problem
    if not allowed(problem):
        return here
    left = left_there(problem, here)
    if left <= _UNFORETOLD * here.cost:
        return here
    before = About.of(problem)
    again = attempt("settled to the last", partial(to_the_last, problem, here, both=False))
    if again is None or left_there(problem, again) > _NEARER * left:
        before.restore(problem)
        return here
    # It may cost more: what slopes foretold of the other was not true.
    search.best = again
    search.stood[search.labels] = again, About.of(problem)
    return again


def _chosen(search: Search, trials: list[Trial], wider: bool) -> Trial | None:
    """The trial that is taken, if any; more candidates are tried where that is `wider`."""
    here = search.best
    tied = [t for t in trials if t.score - trials[0].score < SAME]
    # What only leaves its tolerance need not be seen at every pose: it must not be refuted.
    least = -search.least if allowed(search.problem) else 0.0
    best = holdout_choice([(t, search.held_out_gain(here, t.fit, t.about)) for t in tied], least)
    if best is None and wider:
        # What looked best is none; the right one may not have been among those fitted.
        looked = partial(try_candidates, search, here.hypothesis, wide=True)
        trials[:] = attempt("more candidates", looked) or trials
        held = (t for t in trials if t.finished(search.records) and search.confirmed(t.fit))
        best = next(held, None)
    return best


def _settle(search: Search, newest: str) -> None:
    """What was known before the newest cause, looked at again beside it."""
    # Times of blows may have been missed: then they are looked for once more.
    again = refit_latent(search, search.best, newest if search.leaves_noise(search.best) else "")
    if again.cost < search.best.cost:
        search.best = prune(search, again, alone=False)
    quiet = search.leaves_noise(search.best)
    found = exchange_settled(search, simpler=quiet)
    if found is not None:
        _accept(search, *found)
        quiet = search.leaves_noise(search.best)
    if quiet:
        return
    other = exchange(search)
    if other is not search.best:  # beside the right one, others may have nothing to do
        other = prune(search, other, alone=False)
    _accept(search, other)


def _without_newest(search: Search, newest: str) -> Fit:
    """The fit without its newest cause, where that leaves noise, too.

    Then the others had stopped short of their best, and the newest only moved them on: whether it
    is there is asked once more, with what counts as known held fixed.
    """
    best = search.best
    if newest not in search.labels or len(search.labels) < 2:
        return best
    rest = best.hypothesis.minus(newest)
    without = attempt(f"without {newest}", partial(search.fit, rest, iterations=5))
    return without if without is not None and search.leaves_noise(without) else best


def alternatives(search: Search) -> tuple[list[Trial], list[Trial]]:
    """Other sets of causes that explain as much: each cause replaced by every other suspect.

    Returns:
        those within `SAME`, and all that were fitted to the end.
    """
    best = search.best
    same: list[Trial] = []
    tried: list[Trial] = []
    for cause in best.hypothesis.causes:
        trials = _tried_before(search, cause.label)
        without, about = search.before(cause.label)
        hidden = _hidden_by_tolerances(search, without)
        if not trials or hidden:
            known = {t.label for t in trials if t.finished(search.records)}
            more = rivals_of(search, best, cause.label, MOST_RIVALS)
            if hidden or len(best.hypothesis.causes) == 1:
                more = [*exceeding_trials(search, without, about), *more]
            trials = [*trials, *(t for t in more if t.label not in known)]
        finished = [t for t in trials if t.finished(search.records)]
        finished = settled_alike(search, finished, best, without)
        tried += finished
        for trial in finished:
            if trial.fit.hypothesis.labels == best.hypothesis.labels:
                continue
            compared = partial(_rise, search, trial.fit)
            rise = attempt(trial.label, compared)
            if rise is not None and rise < SAME:
                same.append(trial)
    return same, tried


def _hidden_by_tolerances(search: Search, without: Fit) -> bool:
    """Whether tolerances could make up for what a fit lacks, so that trials say little of it."""
    return allowed(search.problem) and search.leaves_noise(without)


def _rise(search: Search, other: Fit) -> float:
    """By how much another fit does worse than the best, in units of chi-square."""
    rise = bic_difference(search.problem, search.best, other)
    return min(rise, decisive_gain(other, search.best)) if allowed(search.problem) else rise


def _tried_before(search: Search, label: str) -> list[Trial]:
    """What was tried beside the other causes alone, which is what was known in some step."""
    others = search.labels - {label}
    for step in reversed(search.steps):
        if step[0].fit.hypothesis.labels - {step[0].label} == others:
            return [t for t in step if t.label != label]
    return []
