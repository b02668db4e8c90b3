"""One candidate fitted: to the first part of the records, and from there to all of them."""

from __future__ import annotations

from collections.abc import Sequence

from picchio.core.errors import InputError
from picchio.diagnosis.percussion.fit import Fit, fit, fit_growing, kinked
from picchio.diagnosis.percussion.latent_fit import fit_latent
from picchio.diagnosis.percussion.measured_record import MeasuredRecord
from picchio.diagnosis.percussion.problem import Problem
from picchio.diagnosis.percussion.unknowns import Hypothesis
from picchio.model import Effect

# What is screened, and fitted first, s.
SCREEN_WINDOW = 0.3
_ON_THE_WAY = (SCREEN_WINDOW, 2.0 * SCREEN_WINDOW)


def fit_short(
    problem: Problem,
    known: Fit,
    start: Effect,
    records: Sequence[MeasuredRecord],
    window: float | None,
) -> Fit | None:
    """A candidate fitted to the first part of the records."""
    # What has no small size turns all slopes: those that are known say nothing beside it.
    near = None if start.discrete else known
    try:
        hypothesis = known.hypothesis.plus(start)
        if start.latent is not None:
            turns = 0 if start.name == "pulse_jitter" else 1
            first = fit(problem, hypothesis, records, window, iterations=turns)
            return fit_latent(problem, first, type(start), start.target)
        if window is None:
            return fit(problem, hypothesis, records, None, iterations=3, near=near)
        windows = (0.06, 0.16, window)
        return fit_growing(problem, hypothesis, records, windows=windows, iterations=4, near=near)
    except InputError:
        return None


def fit_long(
    problem: Problem,
    short: Hypothesis,
    effect: Effect,
    rival: float,
    records: Sequence[MeasuredRecord],
) -> Fit:
    """A candidate fitted to all of the records."""
    if effect.latent is not None:
        turns = 0 if effect.name == "pulse_jitter" else 3
        long = fit(problem, short, records, None, iterations=turns)
        return fit_latent(problem, long, type(effect), effect.target, rival)
    if kinked(short):  # a small error early is a large one late: not all at once
        short = fit_growing(problem, short, records, windows=_ON_THE_WAY, iterations=3).hypothesis
    return fit(problem, short, records, None, iterations=6, rival=rival)
