"""Where each blow fell, found blow by blow: a start for what all blows' times together must fit.

A blow that comes late changes nothing before it. So the first blow and what follows it until the
second tell stiffnesses and force; then the second blow's time is looked for in what follows it
until the third; and so on.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.diagnosis.percussion.fit import Fit, fit
from picchio.diagnosis.percussion.problem import MeasuredRecord, Problem
from picchio.diagnosis.percussion.unknowns import Hypothesis

# How far a blow is looked for, and how finely at first, in intervals of the blows.
_SPAN = 0.2
_SPACING = 1.0 / 32.0
_HALVINGS = 4
# After so many blows the rest is fitted again.
_REFIT = (1, 2, 4, 8)

Hidden = Mapping[str, tuple[float, ...]]


def blow_by_blow(
    problem: Problem,
    start: Fit,
    hypothesis_with: Callable[[Hypothesis, Hidden], Hypothesis],
) -> Hypothesis:
    """The blows' times of every record, and the rest fitted to them.

    Args:
        problem: data and noise.
        start: what is known so far; its records and its end are used.
        hypothesis_with: (hypothesis, record -> (hits,) s) -> the hypothesis with these times.
    """
    records = start.records
    late = {r.name: np.zeros(int(r.setup.blows.hit.max()) + 1) for r in records}
    here = hypothesis_with(start.hypothesis, _frozen(late))
    for hit in range(1, max(numbers.size for numbers in late.values())):
        struck = [r for r in records if hit < late[r.name].size]
        first = min((hit - _SPAN) * r.setup.blows.interval for r in struck)
        if start.end is not None and first > start.end:
            break
        if hit in _REFIT:
            here = fit(problem, here, records, first, iterations=3).hypothesis
        found = _best_times(problem, here, hypothesis_with, struck, late, hit)
        for record, time in zip(struck, found, strict=True):
            late[record.name][hit] = time
        here = hypothesis_with(here, _frozen(late))
    return here


def _best_times(
    problem: Problem,
    here: Hypothesis,
    hypothesis_with: Callable[[Hypothesis, Hidden], Hypothesis],
    struck: Sequence[MeasuredRecord],
    late: Mapping[str, FloatArray],
    hit: int,
) -> FloatArray:
    """(records,) s: when this blow came, by a grid that is halved about its best point."""
    interval = np.array([r.setup.blows.interval for r in struck])
    end = float(((hit + 1 - _SPAN) * interval).max())

    def cost(times: FloatArray) -> FloatArray:
        trial = dict(late)
        for record, time in zip(struck, times, strict=True):
            trial[record.name] = late[record.name].copy()
            trial[record.name][hit] = time
        there = problem.residuals(hypothesis_with(here, _frozen(trial)).effects, struck, end)
        out = np.empty(len(struck))
        for i, (record, residual) in enumerate(zip(struck, there, strict=True)):
            clock = record.until(end).samples.times
            own = (clock >= (hit - _SPAN) * interval[i]) & (clock < (hit + 1 - _SPAN) * interval[i])
            out[i] = float((residual[:, own] ** 2).sum())
        return np.where(np.isfinite(out), out, np.inf)

    best, lowest = np.zeros(len(struck)), np.full(len(struck), np.inf)
    steps = round(_SPAN / _SPACING)
    for place in range(-steps, steps + 1):
        best, lowest = _better(best, lowest, place * _SPACING * interval, cost)
    for halving in range(1, _HALVINGS + 1):
        middle = best.copy()
        for side in (-1.0, 1.0):
            step = side * _SPACING * interval / 2.0**halving
            best, lowest = _better(best, lowest, middle + step, cost)
    return best


def _better(
    best: FloatArray,
    lowest: FloatArray,
    times: FloatArray,
    cost: Callable[[FloatArray], FloatArray],
) -> tuple[FloatArray, FloatArray]:
    value = cost(times)
    lower = value < lowest
    return np.where(lower, times, best), np.where(lower, value, lowest)


def _frozen(late: Mapping[str, FloatArray]) -> dict[str, tuple[float, ...]]:
    return {name: tuple(float(x) for x in numbers) for name, numbers in late.items()}
