"""A cause told with more numbers: a load with its own centre of mass, a link as a whole body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from picchio.diagnosis.attempt import attempt
from picchio.diagnosis.percussion.criteria.equivalence import bic
from picchio.diagnosis.percussion.search.state import Search, Trial

# Iterations of the fit with more numbers, at most: mass and its place trade off slowly.
_TURNS = 40


def refined(search: Search, trials: Sequence[Trial]) -> list[Trial]:
    """Trials, the best first; the best gives way to an effect that tells it with more numbers.

    That is one that refines its effect (`Effect.refines`), from the values that it has, where more
    than noise is left, it pays for its numbers and the records held out do not speak against it.

    Args:
        search: data and records.
        trials: the best first.

    Returns:
        all of them, the best first; one more where that is told with more numbers.
    """
    best, *others = trials
    if not best.finished(search.records) or search.leaves_noise(best.fit):
        return list(trials)
    for kind, target in search.finer:
        if f"{kind.refines}:{target}" != best.label:
            continue
        (coarse,) = (e for e in best.fit.hypothesis.causes if e.label == best.label)
        finer = kind.finer_than(coarse)
        hypothesis = best.fit.hypothesis.minus(best.label).plus(finer)
        fitted = attempt(finer.label, partial(search.fit, hypothesis, iterations=_TURNS))
        if fitted is None or search.pays(best.fit, fitted) < search.least:
            continue
        held = search.held_out_gain(best.fit, fitted, None)
        if held is None or held > 0.0:
            return [replace(best, label=finer.label, fit=fitted, score=bic(fitted), about=None),
                    *trials]  # fmt: skip
    return [best, *others]
