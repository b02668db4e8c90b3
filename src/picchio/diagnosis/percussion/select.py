"""Greedy choice of causes: screen, fit the best suspects, keep what held-out poses confirm."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from picchio.core.errors import InputError
from picchio.diagnosis.percussion.evidence import Evidence, weigh
from picchio.diagnosis.percussion.fit import Fit, fit, fit_growing
from picchio.diagnosis.percussion.latent import LATENT, fit_latent, hidden_numbers
from picchio.diagnosis.percussion.problem import MeasuredRecord, Problem, signal_power
from picchio.diagnosis.percussion.screen import Suspect, screen
from picchio.diagnosis.percussion.unknowns import Hypothesis
from picchio.model import Effect
from picchio.model.effects import Scales, effect_class

SCREEN_WINDOW = 0.3
MOST_CAUSES = 3
_LEAN = 6
SHORT_LIST = 7
LONG_FITS = 3
# A fit gains more than its screening promises, but hardly three times as much.
_SHORT = 0.3
# Fall of BIC below which nothing is claimed: with a hundred candidates tried, chance alone
# reaches it in less than one of a thousand campaigns.
LEAST_GAIN = 8.0
# The forward model itself is exact to about this share of the signal (sensors smear jumps, second
# order in the deflection): what gains less than that is no cause.
EXACT = 3e-4
# Sets whose BIC is within this cannot be told apart.
SAME = 10.0


@dataclass(frozen=True, eq=False)
class Trial:
    """One candidate fitted."""

    label: str
    fit: Fit
    score: float
    promise: float

    def finished(self, records: Sequence[MeasuredRecord]) -> bool:
        """Whether it was fitted to all of these records."""
        return len(self.fit.records) == len(records)


@dataclass(eq=False)
class Search:
    """What the search for causes has found.

    Attributes:
        baseline: nuisances alone, on the records for fitting.
        best: the hypothesis that stands at the end.
        steps: per step the trials, the best first.
        evidence: on all records used for fitting.
    """

    baseline: Fit
    best: Fit
    steps: list[list[Trial]] = field(default_factory=list)
    scores: list[dict[str, Any]] = field(default_factory=list)
    evidence: Evidence | None = None


def score(found: Fit) -> float:
    """BIC: chi-square and priors, plus ln(samples) for every number the causes hold."""
    causes = found.hypothesis.causes
    numbers = sum(_numbers(effect) for effect in causes)
    numbers_hidden = hidden_numbers(found.hypothesis, len(found.records))
    return found.cost + (numbers + numbers_hidden) * math.log(max(found.samples, 2))


def _numbers(effect: Effect) -> int:
    if effect.latent is not None:
        return 1
    if effect.discrete:
        return 1
    return len(effect.parameters)


def search(
    problem: Problem,
    candidates: Sequence[tuple[type[Effect], str]],
    scales: Scales,
    records: Sequence[MeasuredRecord],
    baseline: Fit,
    *,
    confirmed: Callable[[Fit, Fit], bool] | None = None,
    progress: Callable[[str], None] | None = None,
) -> Search:
    """Add causes one by one while they pay.

    Args:
        problem: data and noise.
        candidates: effects and targets.
        scales: sizes that matter.
        records: to fit; others are held out.
        baseline: the nuisances' fit to them.
        confirmed: (before, after) -> whether the records held out confirm the new cause.
        progress: told what is being done.
    """
    say = progress or (lambda text: None)
    found = Search(baseline, baseline)
    least = max(LEAST_GAIN, EXACT**2 * signal_power(records))
    for number in range(MOST_CAUSES):
        here = found.best
        found.evidence = weigh(problem, here.residuals, here.records)
        say(f"looking for cause {number + 1}")
        quiet = found.evidence.is_noise
        trials = try_candidates(
            problem, here.hypothesis, candidates, scales, records, found, whole=quiet, least=least
        )
        if not trials:
            break
        found.steps.append(trials)
        best = trials[0]
        if score(here) - best.score < least:
            break
        if confirmed is not None and not confirmed(here, best.fit):
            break
        found.best = prune(problem, best.fit, records, least, newest=best.label)
        if found.best.hypothesis.labels == here.hypothesis.labels:
            break
    found.evidence = weigh(problem, found.best.residuals, found.best.records)
    return found


def try_candidates(
    problem: Problem,
    known: Hypothesis,
    candidates: Iterable[tuple[type[Effect], str]],
    scales: Scales,
    records: Sequence[MeasuredRecord],
    log: Search | None = None,
    *,
    short_list: int = SHORT_LIST,
    long_fits: int = LONG_FITS,
    whole: bool = False,
    least: float = 0.0,
) -> list[Trial]:
    """Screen all candidates, fit the best on growing windows; the best first.

    Where plenty is left to explain, the first part of a part of the records screens as well;
    `whole` takes all there is, and stops where no candidate promises anything near `least`.
    """
    some = list(records) if whole else spread_out(records)
    window = None if whole else SCREEN_WINDOW
    start = fit(problem, known, some, window, iterations=4, with_jacobian=True)
    suspects = screen(problem, start, candidates, scales)
    if log is not None:
        log.scores.append(
            {s.label: s.gain - s.numbers * math.log(max(start.samples, 2)) for s in suspects}
        )
    logarithm = math.log(max(start.samples, 2))
    if whole:
        enough = max(-logarithm, _SHORT * least)
        suspects = [s for s in suspects if s.gain - s.numbers * logarithm > enough]
        promising = [s.gain - min(s.numbers, 2) * logarithm > 0.0 for s in suspects]
        if not any(promising):
            return []
    chosen = _short_list(suspects, short_list)
    short = []
    for suspect in chosen:
        tried = [_fit_short(problem, start, s, some, window) for s in suspect.starts]
        good = [t for t in tried if t is not None]
        if good:
            best = min(good, key=lambda f: f.cost)
            short.append((suspect, best, score(best)))
    short.sort(key=lambda item: item[2])
    trials: list[Trial] = []
    lowest = short[0][2] if short else 0.0
    for place, (suspect, found, value) in enumerate(short):
        # What is far behind after the first part will not catch up.
        behind = value - lowest
        late = place >= long_fits or (place > 0 and behind > 0.5 * lowest + 200.0)
        if late and (behind > SAME or place >= 2 * long_fits):
            trials.append(Trial(suspect.label, found, math.inf, suspect.gain))
            continue
        rival = min((t.fit.cost for t in trials if math.isfinite(t.score)), default=math.inf)
        long = _fit_long(problem, found, suspect, records, rival)
        trials.append(Trial(suspect.label, long, score(long), suspect.gain))
    return sorted(trials, key=lambda t: t.score)


def _short_list(suspects: Sequence[Suspect], size: int) -> list[Suspect]:
    """The best, but no more than three of one effect: others deserve a hearing, too."""
    chosen: list[Suspect] = []
    for suspect in suspects:
        same = sum(1 for s in chosen if s.effect.name == suspect.effect.name)
        if same < 3 and suspect.gain > 0.0:
            chosen.append(suspect)
        if len(chosen) == size:
            break
    return chosen


def spread_out(records: Sequence[MeasuredRecord]) -> list[MeasuredRecord]:
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


def _fit_short(
    problem: Problem,
    known: Fit,
    start: Effect,
    records: Sequence[MeasuredRecord],
    window: float | None,
) -> Fit | None:
    """A candidate fitted to the first part of the records."""
    try:
        hypothesis = known.hypothesis.plus(start)
        if start.latent is not None:
            turns = 0 if start.name == "pulse_jitter" else 1
            first = fit(problem, hypothesis, records, window, iterations=turns)
            return fit_latent(problem, first, type(start), start.target)
        if window is None:
            return fit(problem, hypothesis, records, None, iterations=3, near=known)
        windows = (0.06, 0.16, window)
        return fit_growing(problem, hypothesis, records, windows=windows, iterations=4, near=known)
    except InputError:
        return None


def _fit_long(
    problem: Problem,
    short: Fit,
    suspect: Suspect,
    records: Sequence[MeasuredRecord],
    rival: float,
) -> Fit:
    kind = type(suspect.effect)
    if kind.latent is not None:
        turns = 0 if kind.name == "pulse_jitter" else 3
        long = fit(problem, short.hypothesis, records, None, iterations=turns)
        return fit_latent(problem, long, kind, suspect.effect.target)
    return fit(problem, short.hypothesis, records, None, iterations=6, rival=rival)


def prune(
    problem: Problem,
    found: Fit,
    records: Sequence[MeasuredRecord],
    least: float = LEAST_GAIN,
    newest: str = "",
) -> Fit:
    """Take out every cause, the newest included, that the others do without."""
    best = found
    for label in sorted(found.hypothesis.labels, key=lambda text: text == newest):
        if len(best.hypothesis.labels) < 2:
            break
        without = fit(problem, best.hypothesis.minus(label), records, None, iterations=5)
        if score(without) < score(best) + least:
            best = without
    return best


def alternatives(
    problem: Problem,
    found: Search,
    candidates: Sequence[tuple[type[Effect], str]],
    scales: Scales,
    records: Sequence[MeasuredRecord],
) -> tuple[list[tuple[frozenset[str], float]], list[Trial]]:
    """Other sets of causes that explain as much: each cause replaced by every other suspect.

    Returns:
        sets with how much worse their BIC is; and all trials.
    """
    best = found.best
    same, tried = [], []
    reference = score(best)
    for cause in best.hypothesis.causes:
        if len(best.hypothesis.causes) == 1 and found.steps:
            trials = [t for t in found.steps[0] if t.label != cause.label]
        else:
            others = best.hypothesis.minus(cause.label)
            left = [(k, t) for k, t in candidates if f"{k.name}:{t}" != cause.label]
            trials = try_candidates(problem, others, left, scales, records)
        tried += [t for t in trials if t.finished(records)]
        for trial in trials:
            worse = trial.score - reference
            if worse < SAME and trial.fit.hypothesis.labels != best.hypothesis.labels:
                same.append((trial.fit.hypothesis.labels, worse))
    return same, tried


def refit(problem: Problem, hypothesis: Hypothesis, records: Sequence[MeasuredRecord]) -> Fit:
    """A hypothesis refitted to some records, from where it stands, with its Jacobian."""
    hidden = {e.name for e in hypothesis.effects if e.name in LATENT and e.name != "mains_hum"}
    # Blows' times in records that were held out are not known yet: nothing can be fitted to them.
    turns = 0 if "pulse_jitter" in hidden else 4
    found = fit(problem, hypothesis, records, None, iterations=turns, with_jacobian=not hidden)
    for name in hidden:
        found = fit_latent(problem, found, effect_class(name), "tool")
    if hidden:
        found = fit(problem, found.hypothesis, records, None, iterations=1, with_jacobian=True)
    return replace(found)
