"""Where each blow fell, found blow by blow: a start for what all blows' times together must fit.

A blow that comes late changes nothing before it. So the first blow and what follows it until the
second tell stiffnesses and force; then the second blow's time is looked for in what follows it
until the third; and so on.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from picchio.core.arrays import BoolArray, FloatArray
from picchio.diagnosis.percussion.fit import Fit, fit
from picchio.diagnosis.percussion.measured_record import MeasuredRecord
from picchio.diagnosis.percussion.problem import Problem
from picchio.diagnosis.percussion.unknowns import Hypothesis

# How far a blow is looked for, in intervals of the blows; how finely at first, parts of a sample;
# and how often the model is asked on either side of where that leads.
_SPAN = 0.2
_FINER = 4
_MOVES = 3
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
    """(records,) s: when this blow came.

    A blow's response is nearly its own, whatever moves already: so it is found once, and moved
    about to see where it fits best. Then the model has the word, at a few times about that one.
    """
    interval = np.array([r.setup.blows.interval for r in struck])
    end = float(((hit + 1 - _SPAN) * interval).max())

    def at(times: FloatArray) -> Hypothesis:
        trial = dict(late)
        for record, time in zip(struck, times, strict=True):
            trial[record.name] = late[record.name].copy()
            trial[record.name][hit] = time
        return hypothesis_with(here, _frozen(trial))

    def cost(times: FloatArray) -> FloatArray:
        there = problem.residuals(at(times).effects, struck, end)
        out = np.empty(len(struck))
        for i, (record, residual) in enumerate(zip(struck, there, strict=True)):
            own = _window(record.until(end).samples.times, hit, interval[i])
            out[i] = float((residual[:, own] ** 2).sum())
        return np.where(np.isfinite(out), out, np.inf)

    # Without it: so late that nothing of it is seen. A sample is known or not in both alike.
    never = at(np.full(len(struck), 2.0 * end))
    longer = end + _SPAN * float(interval.max())
    with problem.pinned(never.effects):
        gone = problem.residuals(never.effects, struck, longer)
        there = problem.residuals(at(np.zeros(len(struck))).effects, struck, longer)
    middle, spacing = np.empty(len(struck)), np.empty(len(struck))
    for i, (record, without, with_it) in enumerate(zip(struck, gone, there, strict=True)):
        samples = record.setup.samples
        own = _window(record.until(longer).samples.times, hit, interval[i])
        most = int(np.ceil(_SPAN * interval[i] / samples.step))
        place = _place(without, without - with_it, own, most)
        middle[i], spacing[i] = place * samples.step, samples.step / _FINER
    return _refined(cost, middle, spacing)


def _window(times: FloatArray, hit: int, interval: float) -> BoolArray:
    """Which samples tell when a blow came: from when it may have to when the next may."""
    first, last = (hit - _SPAN) * interval, (hit + 1 - _SPAN) * interval
    return np.asarray((times >= first) & (times < last))


def _place(without: FloatArray, response: FloatArray, own: BoolArray, most: int) -> float:
    """By how many samples a response is to be moved to explain most of what is seen without it.

    Args:
        without: (channels, m) residual without the blow.
        response: (channels, m) what the blow adds to the prediction, in the same units.
        own: (m,) where it is looked for.
        most: samples, to either side.
    """
    index = np.flatnonzero(own)
    if not index.size or not (np.isfinite(without).all() and np.isfinite(response).all()):
        return 0.0
    room = most + 1
    padded = np.pad(response, ((0, 0), (room, room)))
    seen = without[:, index]
    best, lowest = 0.0, np.inf
    for step in range(-most * _FINER, most * _FINER + 1):
        whole = step // _FINER
        part = step / _FINER - whole
        here = index + room - whole
        moved = (1.0 - part) * padded[:, here] + part * padded[:, here - 1]
        value = float(((seen - moved) ** 2).sum())
        if value < lowest:
            best, lowest = step / _FINER, value
    return best


def _refined(
    cost: Callable[[FloatArray], FloatArray], middle: FloatArray, spacing: FloatArray
) -> FloatArray:
    """The lowest point of a parabola about the best of three times, (records,) s."""
    for _ in range(_MOVES):
        before, here, after = cost(middle - spacing), cost(middle), cost(middle + spacing)
        with np.errstate(all="ignore"):
            bend = before - 2.0 * here + after
            vertex = np.where(bend > 0.0, 0.5 * (before - after) / bend, 0.0)
        lowest = np.minimum(np.minimum(before, here), after)
        side = np.where(lowest == here, 0.0, np.where(lowest == before, -1.0, 1.0))
        inside = (side == 0.0) & np.isfinite(vertex)
        middle = middle + spacing * np.where(inside, vertex, side)
        if inside.all():
            break
    return middle


def _frozen(late: Mapping[str, FloatArray]) -> dict[str, tuple[float, ...]]:
    return {name: tuple(float(x) for x in numbers) for name, numbers in late.items()}
