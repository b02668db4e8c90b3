"""Trials that come close to one another, compared each about its own inexact numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from picchio.diagnosis.attempt import attempt
from picchio.diagnosis.percussion.criteria.equivalence import SAME, bic
from picchio.diagnosis.percussion.criteria.remainder import allowed, decisive_gain
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.fit.least_squares import Fit, fit, is_nonsmooth
from picchio.diagnosis.percussion.search.state import Search, Trial
from picchio.diagnosis.percussion.tolerance.linearise import ELSE, About, about_another, settled

# So many close trials are settled, each by itself; and how much worse one may be to be close.
_SETTLED = 3
_CLOSE = 5.0 * SAME
# A rival is given up if, its slopes taken anew, it is still behind by this much, and by so many
# times what it fell since they were taken before.
_BEHIND = 3.0 * SAME
_FALLS = 4.0
# What one number gains by chance in one of twenty fits: nothing stands out of the noise so.
_BY_LUCK = 4.0
# One that explains nearly as much may well explain more: it lacks at most this share.
NEARLY = 0.3
# Of the cost without it, beside which a trial leaves little though more than inexactness explains.
_TENTH = 0.1
# The fall of chi-square above which a tolerance may be exceeded.
_EXCEEDING = 9.0


def exceeding_trials(search: Search, without: Fit, about: About) -> list[Trial]:
    """What stands for each tolerance that may be exceeded, fitted; the best first.

    Tolerances together may have made up for one of them, so that its slope alone promises little.

    Args:
        search: data and records.
        without: a fit that may lack one.
        about: what the records were linearised about for it.
    """
    problem, trials = search.problem, []
    with about_another(problem, about):
        if problem.marginal is None:
            return []
        raw = problem.unmarginalised(without.hypothesis.effects, without.records)
        falls = problem.marginal.freed(raw, [record.name for record in without.records])
        for kind, target in search.candidates:
            label = f"{kind.name}:{target}"
            if falls.get(label, 0.0) > _EXCEEDING and label not in without.hypothesis.labels:
                start = without.hypothesis.plus(kind(target))
                found = attempt(label, partial(search.fit, start, iterations=6))
                if found is not None:
                    trials.append(Trial(label, found, bic(found), falls[label]))
    return sorted(trials, key=lambda t: t.score)


def settled_alike(
    search: Search,
    trials: Sequence[Trial],
    best: Fit | None = None,
    without: Fit | None = None,
    near: float = 0.0,
) -> list[Trial]:
    """Trials, the best first; close ones are compared each about its own inexact numbers.

    All were fitted about those of the hypothesis without them, which one may suit better than
    another. Where everything is exact, nothing changes. Where the first leaves noise, though what
    is not exact alone does not, a rival that stays far behind it is given up. Those with kinks take
    longest and come last.

    Args:
        search: data and records.
        trials: the best first.
        best: the fit to come close to; the first trial's where None.
        without: the fit that lacks what the trials are rivals of; the baseline where None.
        near: how much worse than `best` one may be, at least, to be close to it.

    Returns:
        all of them, the best first.
    """
    if not allowed(search.problem) or not trials:
        return list(trials)
    mark = trials[0].fit if best is None else best
    before = search.best if best is None else without or search.baseline
    faint = search.leaves_noise(before)
    if best is None:
        nearly = NEARLY * (before.cost - mark.cost)
    else:  # about the numbers of what is claimed its rivals seem worse than they are
        nearly = (1.0 - NEARLY) * (before.cost - mark.cost) if faint else near
    again: dict[str, Trial] = {}
    left = _SETTLED
    tolerated = _stand_for_tolerances(search.problem) if faint else frozenset()

    def within_reach(trial: Trial) -> float:
        """What it may cost, settled: its slopes tell more than a fit, for which others made up."""
        if trial.label not in tolerated or trial.about is not None or trial.stands is not None:
            return trial.fit.cost
        return min(trial.fit.cost, before.cost - trial.promise)

    def place(trial: Trial) -> float:
        lead = trial.fit.cost - within_reach(trial)
        return bic(trial.fit) - lead if lead > 0.0 else trial.score

    def is_close(trial: Trial) -> bool:
        if not trial.finished(search.records) or trial.draws or trial.in_vain:
            return False
        if best is not None and trial.fit.hypothesis.labels == best.hypothesis.labels:
            return False
        if faint and best is None and before.cost - within_reach(trial) < _BY_LUCK:
            return False
        return decisive_gain(trial.fit, mark) < _CLOSE or within_reach(trial) - mark.cost < nearly

    waiting = sorted(trials, key=place)
    race = _Race(search)
    if not faint:
        # What takes long comes last: it need not go on where another leaves noise.
        some = [trial for trial in waiting if is_close(trial)][:left]
        waiting = sorted(some, key=lambda trial: is_nonsmooth(trial.fit.hypothesis))
        if best is not None and waiting:
            # What the records are linearised about may be another fit's, of all of them.
            refit = partial(search.fit, best.hypothesis, iterations=4)
            if (first := attempt("the first of a race", refit)) is not None:
                race.won_by(first, About.of(search.problem))
    for trial in waiting:
        if not left or not is_close(trial):
            continue
        left -= 1
        again[trial.label] = there = _settled_trial(search, trial, race)
        if faint:  # as much may be there for another
            nearly = max(nearly, trial.fit.cost - there.fit.cost)
        elif there.about is not None and not there.in_vain:
            race.won_by(there.fit, there.about)
    return sorted((again.get(t.label, t) for t in trials), key=lambda t: t.score)


def _settled_trial(search: Search, trial: Trial, race: _Race) -> Trial:
    """A trial about its own inexact numbers; as it was where that is no better."""
    settle = partial(settled_by_itself, search, trial.label, give_up=race.is_behind)
    beside = None
    # Beside causes that leave little, numbers are near where one more small cause has them.
    anew = len(trial.fit.hypothesis.labels) < 2 or _is_far(trial.fit)
    if trial.stands is not None:
        there, about = settle(trial.fit, begin=trial.stands, rounds=1)
    elif (beside := race.beside(trial)) is not None:
        there, about = settle(beside[0], begin=beside[1])
    else:
        there, about = settle(trial.fit, anew=anew, patient=race.first is not None)
    if race.first is None and _is_far(there):
        there, about = _gone_on(search, trial, there, about, anew)
    if there is None or there.cost >= trial.fit.cost:
        # Begun so it would come to the same once more.
        return replace(trial, in_vain=trial.stands is None and (anew or beside is not None))
    return replace(trial, fit=there, score=bic(there), about=about)


class _Race:
    """Gives up what stays far behind a fit that leaves noise.

    Args:
        search: data and records.
    """

    def __init__(self, search: Search) -> None:
        self.search = search
        self.first: tuple[Fit, About] | None = None
        self.stretches: dict[float | None, Fit | None] = {}

    def won_by(self, found: Fit, about: About) -> None:
        """A fit, settled, with what the records are linearised about for it."""
        ahead = self.first is None or found.cost < self.first[0].cost
        if ahead and self.search.leaves_noise(found):
            self.first, self.stretches = (found, about), {}

    def beside(self, trial: Trial) -> tuple[Fit, About] | None:
        """A trial with kinks about the first one's inexact numbers, where those leave little of it.

        Its own slopes take long, and stretch by stretch it comes to no better place.
        """
        if self.first is None or not is_nonsmooth(trial.fit.hypothesis):
            return None
        about, search = self.first[1], self.search
        with about_another(search.problem, about):
            refit = partial(search.fit, trial.fit.hypothesis, iterations=4)
            near = attempt(trial.label, refit)
        return None if near is None or _is_far(near) else (near, about)

    def is_behind(self, found: Fit, fall: float | None) -> bool:
        """Whether a fit on its way stays behind in its stretch, though it falls on as it did."""
        first = self._first_of(found)
        if first is None:
            return False
        more = bic(found) - bic(first)
        gap = min(decisive_gain(found, first), more)
        return gap >= _CLOSE if fall is None else gap >= _BEHIND and more >= _FALLS * fall

    def _first_of(self, found: Fit) -> Fit | None:
        """The first one's fit in the stretch of another."""
        if self.first is None:
            return None
        if found.end not in self.stretches:
            (first, about), problem = self.first, self.search.problem
            with about_another(problem, about):
                again = partial(fit, problem, first.hypothesis, found.records, found.end)
                self.stretches[found.end] = attempt("first", partial(again, iterations=0))
        return self.stretches[found.end]


def _stand_for_tolerances(problem: Problem) -> frozenset[str]:
    """Labels of the causes that a number which is never exact may be, where it is farther off."""
    marginal = problem.marginal
    return frozenset() if marginal is None else marginal.means


def settled_by_itself(
    search: Search,
    label: str,
    start: Fit,
    *,
    anew: bool = True,
    patient: bool = False,
    begin: About | None = None,
    rounds: int = 2,
    give_up: Callable[[Fit, float | None], bool] | None = None,
) -> tuple[Fit | None, About]:
    """A fit about its own inexact numbers, and what the records are linearised about for it.

    Args:
        search: data and records; nothing of it changes.
        label: of what is fitted.
        start: the fit.
        anew: as of `settled`.
        patient: as of `settled`.
        begin: where what is not exact may be, to go on from there; else None.
        rounds: as of `settled`.
        give_up: as of `settled`.

    Returns:
        None where that fails.
    """
    anew = anew and begin is None
    with about_another(search.problem, begin):
        settle = partial(
            settled, search.problem, start, search.records, rounds,
            anew=anew, patient=patient, give_up=give_up,
        )  # fmt: skip
        return attempt(label, settle), About.of(search.problem)


def _gone_on(
    search: Search,
    trial: Trial,
    there: Fit | None,
    about: About,
    anew: bool,
) -> tuple[Fit | None, About]:
    """A trial settled however much is left on the way; as it was, where that is in vain.

    Where all but what is not exact is explained, that is rather farther off than slopes reach:
    from where it is stated, or from where it has come so far.
    """
    nearest = trial.fit if there is None else min(trial.fit, there, key=lambda found: found.cost)
    if nearest.cost >= _TENTH * search.best.cost:
        return there, about
    settle = partial(settled_by_itself, search, trial.label, patient=True)
    other, elsewhere = settle(trial.fit, anew=anew)
    if _is_far(other) and nearest is there:
        with about_another(search.problem, about):
            other, elsewhere = settle(nearest, anew=False)
    return (there, about) if _is_far(other) else (other, elsewhere)


def _is_far(found: Fit | None) -> bool:
    return found is None or found.chi_square > ELSE * found.samples
