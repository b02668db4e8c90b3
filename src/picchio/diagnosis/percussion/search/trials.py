"""One round: screen all candidates, fit the most promising, rank them."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from picchio.core.workers import worker_pool
from picchio.diagnosis.attempt import attempt, trials
from picchio.diagnosis.percussion.criteria.equivalence import SAME, bic
from picchio.diagnosis.percussion.criteria.remainder import allowed
from picchio.diagnosis.percussion.data.problem import MeasuredRecord, Problem
from picchio.diagnosis.percussion.fit.drawn import fit_latent
from picchio.diagnosis.percussion.fit.least_squares import Fit, fit, fit_growing, is_nonsmooth
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.search.screen import Screen, Suspect, resized
from picchio.diagnosis.percussion.search.state import Search, Trial
from picchio.model.effects.effect import Effect

# One candidate fitted: to the first part of the records, and from there to all of them.

# What is screened, and fitted first, s.
SCREEN_WINDOW = 0.3
# How small a candidate is made, of what was tried, that fits worse than none.
_SMALLER = 0.1
_ON_THE_WAY = (SCREEN_WINDOW, 2.0 * SCREEN_WINDOW)


def fit_short(
    problem: Problem,
    known: Fit,
    start: Effect,
    records: Sequence[MeasuredRecord],
    window: float | None,
) -> Fit:
    """A candidate fitted to the first part of the records."""
    # What has no small size turns all slopes: those that are known say nothing beside it.
    near = None if start.discrete else known
    hypothesis = known.hypothesis.plus(start)
    if start.latent is not None:
        turns = 0 if start.latent.times else 1
        first = fit(problem, hypothesis, records, window, iterations=turns)
        return fit_latent(problem, first, start)
    if window is None:
        found = fit(problem, hypothesis, records, None, iterations=3, near=near)
        if found.cost <= known.cost or start.discrete:
            return found
        # Worse than without it: it began too far from doing nothing.
        smaller = known.hypothesis.plus(resized(start, _SMALLER))
        again = fit(problem, smaller, records, None, iterations=3, near=near)
        return min(found, again, key=lambda each: each.cost)
    windows = (0.06, 0.16, window)
    return fit_growing(problem, hypothesis, records, windows=windows, iterations=4, near=near)


def fit_long(
    problem: Problem,
    short: Hypothesis,
    effect: Effect,
    rival: float,
    records: Sequence[MeasuredRecord],
) -> Fit:
    """A candidate fitted to all of the records."""
    if effect.latent is not None:
        turns = 0 if effect.latent.times else 3
        long = fit(problem, short, records, None, iterations=turns)
        return fit_latent(problem, long, effect, rival)
    if is_nonsmooth(short):  # a small error early is a large one late: not all at once
        short = fit_growing(problem, short, records, windows=_ON_THE_WAY, iterations=3).hypothesis
    return fit(problem, short, records, None, iterations=6, rival=rival)


# Where nothing explains half of what is left there, this much of it is screened as well, s.
_EARLY = 0.08
_HALF = 0.5
_MOST_EARLY = 3
_LEAN = 6
SHORT_LIST = 7
LONG_FITS = 3
# A fit gains more than its screening promises, but hardly three times as much.
_SHORT = 0.3
# What promises less than this share of what the cause itself promised is no rival of it.
_HOPE = 0.1
# Numbers that are drawn anew in every record are screened as free as they are: nothing to add.
_HOPE_LATENT = 0.8
_RIVALS = 2
# Relative difference of what two suspects explain that do the same to the data.
_TWIN = 1e-4
MOST_RIVALS = 5
# Chi-square per sample up to which the first part of a part of the records shows nothing.
_LITTLE = 1.2
# By what share of what the best explains beyond the last one's another may explain less.
_NEARBY = 0.05
# How many times the average what is not exact may leave: few numbers make most of it, and the
# square of one is beyond that in one of twenty.
_BY_CHANCE = 4.0


def try_candidates(
    search: Search,
    known: Hypothesis,
    *,
    short_list: int = SHORT_LIST,
    whole: bool = False,
    wide: bool = False,
    cause: str = "",
    best: Fit | None = None,
) -> list[Trial]:
    """Screen all candidates, fit the best on growing windows; the best first.

    Where plenty is left to explain, the first part of a part of the records screens as well;
    `whole` takes all there is, and stops where no candidate promises anything near what is asked
    for. `wide` fits three times as many suspects, those included that look promising very early.
    With a `cause`, which is a label among the candidates, its rivals are looked for: it is screened
    to know what may be expected of them; `best` is the fit to all records that has it.
    """
    problem, scales, candidates = search.problem, search.scales, search.candidates
    records = search.records
    some = list(records) if whole else records_of_every_pose(records)
    window = None if whole else SCREEN_WINDOW
    start = fit(problem, known, some, window, iterations=4, with_jacobian=True)
    if not whole and start.chi_square < _LITTLE * start.samples:
        # What is wrong shows only later, or in other records.
        some, window = list(records), None
        start = fit(problem, known, some, window, iterations=4, with_jacobian=True)
    enough = _SHORT * search.least
    screen = Screen(problem, start, scales, faint=whole, enough=enough if whole else 0.0)
    early = None
    if window is not None:
        begun = fit(problem, known, some, _EARLY, iterations=4, with_jacobian=True)
        early = Screen(problem, begun, scales, early=True)

    def short_fit(effect: Effect) -> Fit:
        return _light(fit_short(problem, start, effect, some, window))

    def long_fit(task: tuple[Hypothesis, Effect, float]) -> Fit:
        return _light(fit_long(problem, *task, records))

    # What takes long begins first, or all others would wait for it at the end.
    candidates = sorted(candidates, key=lambda c: c[0].latent is None)
    functions: dict[str, Callable[[Any], Any]]
    functions = {"screen": screen.suspect, "short": short_fit, "long": long_fit}
    if early is not None:
        functions["early"] = early.suspect
    with worker_pool(problem.workers, trials(functions)) as mapped:
        suspects = screen.ranked(mapped("screen", candidates))
        logarithm = math.log(max(start.samples, 2))
        if whole:
            least = max(-logarithm, enough)
            suspects = [s for s in suspects if s.gain - s.numbers * logarithm > least]
            if not any(s.gain - min(s.numbers, 2) * logarithm > 0.0 for s in suspects):
                return []
        if cause:
            suspects = _rivals(suspects, cause)
        long_fits = 2 * LONG_FITS if wide else LONG_FITS
        size = 3 * short_list if wide else short_list
        chosen = _short_list(suspects, size, start.hypothesis.at_ends)
        promised = max((s.gain for s in suspects), default=0.0)
        little = wide or promised < _HALF * screen.total
        if early is not None and not cause and little:
            # Growing errors are recognisable only early.
            chosen = _joined(chosen, early.ranked(mapped("early", candidates)))
        tried = [(suspect, effect) for suspect in chosen for effect in suspect.starts]
        tried.sort(key=lambda each: each[1].latent is None)
        fits = mapped("short", [effect for _, effect in tried])
        short = _best_of_each(tried, fits, some)
        # About another's inexact numbers a true cause may leave more than one that is alike; about
        # none, as much as they do.
        spread = short[-1][2] - short[0][2] if short and allowed(problem) else 0.0
        nearby = max(_NEARBY * spread, _BY_CHANCE * problem.unsettled * start.samples)
        if best is None or not short:
            return _long_trials(mapped, short, list(records), long_fits, nearby)
        own = fit(problem, best.hypothesis, some, window, iterations=2)
        mark = min(bic(own), short[0][2])
        return _long_trials(mapped, short, list(records), long_fits, nearby, mark, best.cost)


def _joined(chosen: Sequence[Suspect], early: Sequence[Suspect]) -> list[Suspect]:
    """Those chosen, with the best of another screening and the sizes that it would start from."""
    best = {s.label: s for s in _short_list(early, _MOST_EARLY)}
    joined = []
    for suspect in chosen:
        other = best.pop(suspect.label, None)
        starts = other.starts[:1] if other and suspect.effect.latent is None else ()
        joined.append(replace(suspect, starts=(*suspect.starts, *starts)))
    return [*joined, *best.values()]


def _rivals(suspects: Sequence[Suspect], cause: str) -> list[Suspect]:
    """Those that may do as well as the cause; the best few however little they promise."""
    own = max((s.gain for s in suspects if s.label == cause), default=0.0)
    chosen: list[Suspect] = []
    for s in suspects:
        latent = s.effect.latent is not None
        hopeful = s.gain >= (_HOPE_LATENT if latent else _HOPE) * own
        if s.label != cause and (hopeful or (len(chosen) < _RIVALS and not latent)):
            chosen.append(s)
    return chosen


def _light(found: Fit) -> Fit:
    """A fit without its records, which whoever asked for it has."""
    return replace(found, records=())


def _best_of_each(
    tried: Sequence[tuple[Suspect, Effect]],
    fits: Sequence[Fit | None],
    records: Sequence[MeasuredRecord],
) -> list[tuple[Suspect, Fit, float]]:
    """Every suspect with its best fit and that one's score, the best first."""
    found: dict[str, tuple[Suspect, Fit, float]] = {}
    for (suspect, _), light in zip(tried, fits, strict=True):
        if light is None:
            continue
        known = found.get(suspect.label)
        if known is None or light.cost < known[1].cost:
            own = replace(light, records=tuple(records))
            found[suspect.label] = (suspect, own, bic(own))
    return sorted(found.values(), key=lambda item: item[2])


def _long_trials(
    mapped: Callable[[str, Iterable[Any]], list[Any]],
    short: Sequence[tuple[Suspect, Fit, float]],
    records: Sequence[MeasuredRecord],
    long_fits: int,
    nearby: float = 0.0,
    mark: float | None = None,
    rival: float = math.inf,
) -> list[Trial]:
    """Those that did best so far, fitted to everything; the best first.

    What is behind by no more than `nearby` is fitted as well. `mark` is the score to come near to
    in the first part, `rival` the cost to come near to in all.
    """
    trials: list[Trial] = []
    wanted: list[tuple[Suspect, Fit]] = []
    for place, (suspect, found, value) in enumerate(short):
        # What is far behind after the first part will not catch up.
        mark = value if mark is None else mark
        behind = value - mark
        # One is fitted all the same, to tell how much better the best is; if it does not take long.
        told = bool(wanted) or suspect.effect.latent is not None
        far = max(0.5 * mark + 200.0, nearby)
        late = place >= long_fits or (told and behind > far)
        if late and (behind > SAME or place >= 2 * long_fits):
            trials.append(Trial(suspect.label, found, math.inf, suspect.gain))
        else:
            wanted.append((suspect, found))
    # The first is the others' rival: a fit that stays far above it is given up. It is fitted here,
    # where other processes may predict some of its records.
    others = sorted(wanted[1:], key=lambda each: each[0].effect.latent is None)
    for some in (wanted[:1], others):
        tasks = [(found.hypothesis, suspect.effect, rival) for suspect, found in some]
        for (suspect, found), light in zip(some, mapped("long", tasks), strict=True):
            if light is None:  # it failed: it was not fitted to the end
                trials.append(Trial(suspect.label, found, math.inf, suspect.gain))
                continue
            long = replace(light, records=tuple(records))
            rival = min(rival, long.cost)
            trials.append(Trial(suspect.label, long, bic(long), suspect.gain))
    return sorted(trials, key=lambda t: t.score)


def _short_list(
    suspects: Sequence[Suspect], size: int, asking: Collection[str] = ()
) -> list[Suspect]:
    """The best, but no more than three of one effect: others deserve a hearing, too.

    Whatever explains exactly as much as one of them is there as well: it may be the same thing. So
    is what is `asking` to leave its tolerance: how far it would go no slope tells.
    """

    def twins(one: Suspect, other: Suspect) -> bool:
        return one.numbers == other.numbers and abs(one.gain - other.gain) < _TWIN * one.gain

    chosen: list[Suspect] = []
    for suspect in suspects:
        late = len(chosen) >= size and not any(twins(suspect, s) for s in chosen)
        if late and suspect.label not in asking:
            continue
        same = sum(1 for s in chosen if s.effect.name == suspect.effect.name)
        if same < 3 and suspect.gain > 0.0:
            chosen.append(suspect)
    return chosen


def records_of_every_pose(records: Sequence[MeasuredRecord]) -> list[MeasuredRecord]:
    """One or two records of every pose, their directions taken in turn."""
    by_pose: dict[int, list[MeasuredRecord]] = {}
    for record in records:
        by_pose.setdefault(record.pose, []).append(record)
    per_pose = max(1, math.ceil(_LEAN / len(by_pose)))
    chosen = []
    for turn, own in enumerate(by_pose.values()):
        order = own[turn % len(own) :] + own[: turn % len(own)]
        chosen += order[:per_pose]
    return chosen


# Which of the trials of a round is chosen: compared over the same samples, and held out.

# Fall of BIC up to which a rival may owe its place to the samples that it counts as known.
_ROUGH = 100.0


def holdout_choice(tied: Sequence[tuple[Trial, float | None]], least: float = 0.0) -> Trial | None:
    """Of trials that do as well, the first that the records held out confirm, or clearly prefer.

    Args:
        tied: with the fall of chi-square there, None where they can't tell.
        least: fall that must be exceeded there.
    """
    held = [(t, gain) for t, gain in tied if gain is None or gain > least]
    if not held:
        return None
    best, own = held[0]
    if own is None:
        return best
    other, most = max(held, key=lambda each: -math.inf if each[1] is None else each[1])
    return other if most is not None and most > own + SAME else best


def over_the_same_samples(search: Search, trials: Sequence[Trial]) -> list[Trial]:
    """Trials, the best first; where that leaves noise, close rivals are compared with it anew.

    Each was fitted with its own choice of which samples are known, by which its cost is rough: a
    fit may stop early, or gain by what it leaves out. Now all count those of the best.
    """
    best = trials[0]
    close = [
        t
        for t in trials
        if t.finished(search.records) and t.score - best.score < _ROUGH and not t.draws
    ]
    if best not in close or len(close) < 2:
        return list(trials)
    if not search.leaves_noise(best.fit):
        return list(trials)
    with search.problem.pinned(best.fit.hypothesis.effects):
        again = []
        for t in close:
            there = attempt(t.label, partial(search.fit, t.fit.hypothesis, iterations=6))
            if there is not None:
                again.append(replace(t, fit=there, score=bic(there)))
    others = [t for t in trials if t not in close]
    return sorted([*again, *others], key=lambda t: t.score)
