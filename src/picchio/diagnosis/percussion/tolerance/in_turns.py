"""What is drawn anew in every record, and what is never exact: sought in turns."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from picchio.diagnosis.attempt import attempt
from picchio.diagnosis.percussion.criteria.remainder import allowed
from picchio.diagnosis.percussion.data.problem import MeasuredRecord, Problem
from picchio.diagnosis.percussion.fit.drawn import (
    blow_by_blow,
    current_hidden,
    fit_latent,
    refit,
    with_hidden,
)
from picchio.diagnosis.percussion.fit.least_squares import Fit, fit
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.tolerance.alone import behind
from picchio.diagnosis.percussion.tolerance.linearise import (
    ELSE,
    About,
    about_another,
    settled,
)
from picchio.model.effects.effect import Effect

_TURNS = 4
# What share of the cost a turn must take for another to be worth while.
_LITTLE = 1e-3


def settled_in_turns(problem: Problem, found: Fit) -> Fit:
    """A fit with numbers drawn anew in every record, settled on together with what is not exact.

    Each was sought while the other was not where it is: the blows' times beside masses and poses as
    they are stated, or of a record that had been held out. One fit of both would ask for slopes of
    what is not exact at every step.

    Args:
        problem: linearised about the fit; about the other one, where that is better.
        found: the fit.

    Returns:
        the better one; itself, where nothing is drawn or everything is exact, or where more is
        wrong than what is not exact.
    """
    if (
        not found.hypothesis.drawing
        or not allowed(problem)
        or found.chi_square > ELSE * found.samples
    ):
        return found
    for _ in range(_TURNS):
        with about_another(problem):
            again = attempt("in turns", partial(_turn, problem, found))
            about = About.of(problem)
        if again is None or again.cost >= found.cost:
            break
        about.restore(problem)
        before, found = found, again
        if before.cost - found.cost < _LITTLE * before.cost:
            break
    return found


def refit_in_turns(
    problem: Problem, hypothesis: Hypothesis, records: Sequence[MeasuredRecord]
) -> Fit:
    """A hypothesis refitted to records of which some were held out, with its Jacobian.

    Args:
        problem: linearised about the hypothesis; about the fit, where numbers are drawn.
        hypothesis: as it was fitted to the others.
        records: to fit.

    Returns:
        the fit.
    """
    found = refit(problem, hypothesis, records)
    again = settled_in_turns(problem, found)
    if again is found:
        return found
    return fit(problem, again.hypothesis, records, None, iterations=1, with_jacobian=True)


def _turn(problem: Problem, found: Fit) -> Fit:
    """What is not exact, then what is drawn."""
    found = settled(problem, found, found.records, rounds=1, anew=False)
    for effect in found.hypothesis.drawing:
        found = _drawn_again(problem, fit_latent(problem, found, effect), effect)
    return found


def _drawn_again(problem: Problem, found: Fit, effect: Effect) -> Fit:
    """Blows' times sought once more, blow by blow, in records that are left behind."""
    assert effect.latent is not None
    left = behind(found.records, found.residuals)
    if not effect.latent.times or not left:
        return found
    alone = fit(problem, found.hypothesis, left, None, iterations=0)
    times = current_hidden(blow_by_blow(problem, alone, effect), effect.label)
    every = {**current_hidden(found.hypothesis, effect.label), **times}
    start = fit(problem, with_hidden(found.hypothesis, effect, every), found.records, iterations=0)
    return min(found, fit_latent(problem, start, effect), key=lambda each: each.cost)
