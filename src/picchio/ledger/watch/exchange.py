"""Another robot: many readings of a robot that change at once, and whose they then are."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.ledger.watch.changes import FIRST, Reading, date_of, scores

_OF_THE_TOOL = ("force_drift", "pulse_width", "pulse_rate")
# Of a robot's readings that must change together. One joint may happen to be alike in two robots.
_SHARE = 0.75
_FEWEST = 3  # readings, below which nothing can be said
_LENGTHS = (3, 6, 12, 24)  # shifts before and after
ALARMS = 0.02
"""Share of histories of `_HORIZON` shifts of one robot in which one is told nevertheless."""
_HORIZON, _HISTORIES = 200, 1000
_SMALLEST = 0.005  # relative: the middle one of the changes; logs of one robot differ so little
_REFERENCE = 20.0  # deg C, as of ISO 1
_CLOSE = 3.0  # standard deviations, root mean square: so near another robot's past must be


@dataclass(frozen=True)
class Exchange:
    """When a robot's readings became those of another.

    Attributes:
        since: ns, the first shift of the other.
        names: of the readings that changed.
        before: {reading: (mean, standard deviation of a shift)}, until then.
        after: the same, from then on.
    """

    since: int
    names: tuple[str, ...]
    before: Mapping[str, tuple[float, float]]
    after: Mapping[str, tuple[float, float]]

    @property
    def words(self) -> str:
        """In a sentence."""
        return (f"since {date_of(self.since)} these look like the logs of another robot, or of "
                f"another tool: {' and '.join(self.names)} changed at once")  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """As the JSON of a count has it."""
        return {"since": date_of(self.since), "readings": list(self.names), "words": self.words}


def exchange(readings: Sequence[Reading], alarms: float = ALARMS) -> Exchange | None:
    """The most sudden change of most of a robot's readings, if there is one.

    At every shift a step is fitted to as many shifts before and after, beside a trend, which is
    wear; it is told in standard errors. Of the steps at one moment that one counts which three
    quarters of the readings reach: one joint that breaks is no exchange. What it exceeds in so few
    histories in which nothing happens is simulated.

    Args:
        readings: of one robot; those of its tool do not count.
        alarms: share of histories without an exchange in which one is told.
    """
    own = [r for r in readings if r.effect not in _OF_THE_TOOL and r.values.size > FIRST]
    if len(own) < _FEWEST:
        return None
    when = np.unique(np.concatenate([r.when for r in own]))
    # A reading that a shift lacks is what it was before.
    table = np.array([
        scores(r)[np.maximum(np.searchsorted(r.when, when, side="right") - 1, 0)] for r in own
    ])  # fmt: skip
    most, at, length = _most(table[None], _needed(len(own)))
    k, reach = int(at[0]), int(length[0])
    if not most[0] > _limit(len(own), alarms):
        return None
    sizes = table[:, k - reach : k + reach] @ _step(reach)
    moved = []
    for i in np.argsort(-np.abs(sizes))[: _needed(len(own))]:
        values, clock = own[i].values, own[i].when
        near = [values[clock < when[k]][-reach:], values[clock >= when[k]][:reach]]
        moved.append(abs(float(near[1].mean() - near[0].mean())))
    if np.median(moved) < _SMALLEST:
        return None
    changed = tuple(own[i].name for i in range(len(own)) if abs(sizes[i]) >= most[0])
    sides = [
        {r.name: _signature(_as_at_20(r, int(when[k]))[part]) for r in own
         if (part := (r.when >= when[k]) == late).any()}
        for late in (False, True)
    ]  # fmt: skip
    return Exchange(int(when[k]), changed, *sides)


def signature(readings: Sequence[Reading]) -> dict[str, tuple[float, float]]:
    """What a robot's readings are like: {reading: (mean, standard deviation of a shift)}.

    Args:
        readings: of one robot.
    """
    return {
        r.name: _signature(_as_at_20(r, int(r.when[0])))
        for r in readings
        if r.effect not in _OF_THE_TOOL and r.values.size > 1
    }


def _as_at_20(reading: Reading, since: int) -> FloatArray:
    """The values as they were at 20 deg C: robots are compared at one temperature.

    What a degree does is fitted beside a mean before and one since.
    """
    late = reading.when >= since
    warmer = reading.covariates - _REFERENCE
    table = np.column_stack([~late, late, warmer.T]).astype(float)
    slope = np.linalg.lstsq(table, reading.values, rcond=None)[0][2:]
    return np.asarray(reading.values - slope @ warmer)


def _signature(values: FloatArray) -> tuple[float, float]:
    # By the steps: neither a trend nor one change makes it larger.
    steps = np.abs(np.diff(values))
    spread = 1.048 * float(np.median(steps)) if steps.size else 0.0
    return float(np.median(values)), spread


def whose(
    found: Exchange, others: Mapping[str, Mapping[str, tuple[float, float]]]
) -> tuple[str, float] | None:
    """The robot of a fleet whose past the readings after an exchange are like.

    Args:
        found: the exchange.
        others: signatures of the other robots, before they were exchanged themselves.

    Returns:
        its name, and how far it is, in standard deviations; None where none is near.
    """
    distances = {}
    for name, told in others.items():
        parts = []
        for reading, (mean, spread) in found.after.items():
            if reading in told:
                here = math.hypot(max(spread, told[reading][1]), _SMALLEST)
                parts.append(((mean - told[reading][0]) / here) ** 2)
        if len(parts) >= _FEWEST:
            distances[name] = math.sqrt(sum(parts) / len(parts))
    if not distances:
        return None
    name = min(distances, key=distances.__getitem__)
    return (name, distances[name]) if distances[name] < _CLOSE else None


def _needed(count: int) -> int:
    return max(2, math.ceil(_SHARE * count))


@cache
def _step(length: int) -> FloatArray:
    """(2 length,) weights that give a step in the middle, in its standard error, beside a trend."""
    index = np.arange(2.0 * length)
    basis = np.linalg.qr(np.column_stack([np.ones_like(index), index]))[0]
    step = (index >= length).astype(float)
    step = step - basis @ (basis.T @ step)
    return np.asarray(step / np.linalg.norm(step))


def _most(tables: FloatArray, needed: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Of histories (h, r, t) the largest step that so many readings reach; where, how long."""
    best, at, how = (np.zeros(len(tables)) for _ in range(3))
    for length in _LENGTHS:
        begin = max(0, FIRST // 2 - length)  # the first shifts gave the spread
        if tables.shape[2] - begin < 2 * length:
            continue
        windows = np.lib.stride_tricks.sliding_window_view(tables[:, :, begin:], 2 * length, axis=2)
        size = np.sort(np.abs(windows @ _step(length)), axis=1)[:, -needed]
        top = size.argmax(axis=1)
        value = size[np.arange(len(size)), top]
        better = value > best
        best = np.where(better, value, best)
        at = np.where(better, top + begin + length, at)
        how = np.where(better, length, how)
    return best, at, how


@cache
def _limit(count: int, alarms: float) -> float:
    """What the largest comparison exceeds so rarely where nothing happens."""
    rng = np.random.default_rng(31)
    values = rng.standard_normal((_HISTORIES, count, _HORIZON))
    first = values[:, :, :FIRST]
    values = (values - first.mean(axis=2, keepdims=True)) / first.std(axis=2, ddof=1, keepdims=True)
    return float(np.quantile(_most(values, _needed(count))[0], 1.0 - alarms))
