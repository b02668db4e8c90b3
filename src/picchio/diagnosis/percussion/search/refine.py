"""A cause told with more numbers, as a load with its own centre of mass, or with fewer."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from picchio.diagnosis.attempt import attempt
from picchio.diagnosis.percussion.criteria.equivalence import bic
from picchio.diagnosis.percussion.search.state import Search, Trial

# Iterations of the fit with more numbers, at most: mass and its place trade off slowly.
_TURNS = 40
# What few numbers explain of what those drawn anew do, for them to be what is there.
_MOST = 0.5


def coarsened(search: Search, trials: Sequence[Trial]) -> list[Trial]:
    """Trials, the best first; numbers drawn in every record give way to the few that they follow.

    Each blow a little earlier than the one before is another rate of the blows. From the programmed
    times that was too far off to be found, where something else is wrong as well; what so many
    numbers explain beyond it is of that.

    Args:
        search: data and records.
        trials: the best first.

    Returns:
        the best first, without the one that gave way.
    """
    best = trials[0]
    if not best.draws or not best.finished(search.records):
        return list(trials)
    (drawn,) = (e for e in best.fit.hypothesis.causes if e.label == best.label)
    rest = best.fit.hypothesis.minus(best.label)
    intervals = {record.name: record.setup.blows.interval for record in search.records}
    for start in drawn.coarser(intervals):
        if start.label not in search.considered or start.label in rest.labels:
            continue
        found = attempt(start.label, partial(search.fit, rest.plus(start), iterations=_TURNS))
        explained = 0.0 if found is None else search.best.cost - found.cost
        if found is not None and explained > _MOST * (search.best.cost - best.fit.cost):
            others = [t for t in trials if t.label not in (best.label, start.label)]
            told = Trial(start.label, found, bic(found), best.promise)
            return sorted([told, *others], key=lambda t: t.score)
    return list(trials)


def refined(search: Search, trials: Sequence[Trial]) -> list[Trial]:
    """Trials, the best first; the best gives way to an effect that tells it with more numbers.

    That is one that refines its effect (`Effect.refines`), from the values that it has, where more
    than noise is left, and no more than noise (or a remainder that is allowed) with it: many
    numbers can also stand for several causes. The records held out must not speak against it.

    Args:
        search: data and records.
        trials: the best first.

    Returns:
        all of them, the best first; one more where that is told with more numbers.
    """
    best = trials[0]
    if not best.finished(search.records) or search.leaves_noise(best.fit):
        return list(trials)
    (coarse,) = (e for e in best.fit.hypothesis.causes if e.label == best.label)
    rest, tried = best.fit.hypothesis.minus(best.label), []
    for kind, target in search.finer:
        if (kind.refines, target) == (coarse.name, coarse.target):
            for start in kind.finer_than(coarse):
                go = partial(search.fit, rest.plus(start), iterations=_TURNS)
                tried.append((start.label, attempt(start.label, go)))
    found = [(label, each) for label, each in tried if each is not None]
    for label, fitted in sorted(found, key=lambda each: bic(each[1])):
        quiet = search.leaves_noise(fitted) or search.explains_enough(fitted)
        if not quiet or search.pays(best.fit, fitted) < search.least:
            continue
        held = search.held_out_gain(best.fit, fitted)
        if held is None or held > 0.0:
            finer = Trial(label, fitted, bic(fitted), best.promise)
            return [finer, *trials]
    return list(trials)
