"""What slopes at a fit promise of every candidate, by one small matrix."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.diagnosis.evidence.arrow import reduce
from picchio.diagnosis.evidence.estimate import (
    Fit,
    objective,
    scaled,
    squares_of,
    standardised,
)
from picchio.diagnosis.evidence.numbers import Numbers
from picchio.diagnosis.percussion.likelihood.causes import Cause
from picchio.diagnosis.percussion.likelihood.slopes import Candidate, Slopes

_PART = 0.02  # of the size at which an effect is tried: small enough for a slope
_FARTHEST = 4.0  # times that size: farther no slope is believed


@dataclass(frozen=True, eq=False)
class Promise:
    """What slopes promise of a candidate.

    Attributes:
        gain: in score, nats.
        label: effect and target.
        cause: at the values that are promised.
    """

    gain: float
    label: str
    cause: Cause


@dataclass(frozen=True, eq=False)
class _Column:
    label: str
    cause: Cause
    candidate: Candidate
    group: int  # columns of one group are solved for together


def screen(
    fit: Fit, starts: Mapping[str, Sequence[Cause]], end: float | None, price: float
) -> list[Promise]:
    """The best promise of each candidate, the most promising first.

    Args:
        fit: about which.
        starts: label -> sizes and kinds at which a candidate is tried.
        end: s, up to when records are looked at.
        price: nats, log of the number of candidates.
    """
    have = {cause.label for cause in fit.likelihood.causes}
    columns = _columns({label: own for label, own in starts.items() if label not in have})
    few, at = fit.likelihood.some(fit.at)
    likelihood = replace(few, end=end, edges=()).about(at)
    residuals = likelihood.residuals(at)
    slopes = Slopes.of(likelihood, at, [column.candidate for column in columns])
    prior, n = likelihood.prior, at.shared.size
    wide = np.array([_width(column.cause) for column in columns])
    std = Numbers(np.append(prior.std.shared, wide), prior.std.groups, prior.std.records)
    grams = scaled(slopes.grams(residuals), likelihood.group_of, std)
    there = standardised(prior, at)
    there = replace(there, shared=np.append(there.shared, np.zeros(wide.size)))
    weights = objective(likelihood, at, squares_of(residuals)).weights
    system = reduce(grams, likelihood.group_of, weights, there)
    known = np.linalg.solve(system.precision[:n, :n], system.precision[:n, n:])
    precision = system.precision[n:, n:] - system.precision[n:, :n] @ known
    pull = system.pull[n:] - known.T @ system.pull[:n]
    best: dict[str, Promise] = {}
    for group in dict.fromkeys(column.group for column in columns):
        own = [k for k, column in enumerate(columns) if column.group == group]
        promise = _promise([columns[k] for k in own], precision[np.ix_(own, own)], pull[own],
                           wide[own], price)  # fmt: skip
        if promise and (promise.label not in best or promise.gain > best[promise.label].gain):
            best[promise.label] = promise
    return sorted(best.values(), key=lambda one: -one.gain)


def _columns(starts: Mapping[str, Sequence[Cause]]) -> list[_Column]:
    found: list[_Column] = []
    for label, own in starts.items():
        apart = [{n.parameter for n, u in _amounts(c) if u} for c in own]
        together = (
            len(own) > 1
            and all(apart)
            and all(not a & b for i, a in enumerate(apart) for b in apart[:i])
        )
        first = len(found)
        for cause in own:
            group = first if together else len(found)
            if not _amounts(cause):
                found.append(_Column(label, cause, Candidate(cause.effect, 1.0), group))
                continue
            found.append(_Column(label, cause, Candidate(cause.partly(_PART), _PART), group))
            if "modal_share" in cause.effect.values:  # how it is damped: either way, or between
                other = replace(cause, effect=cause.effect.with_values(modal_share=0.0))
                found.append(_Column(label, other, Candidate(other.partly(_PART), _PART), group))
    return found


def _amounts(cause: Cause) -> list[tuple]:
    """Numbers that say how much, with their coordinates."""
    pairs = zip(cause.numbers, cause.coordinates(cause.effect), strict=True)
    return [(n, u) for n, u in pairs if n.amount]


def _width(cause: Cause) -> float:
    """How wide the prior of a column's amplitude is."""
    return max((n.std / max(abs(u), 1e-12) for n, u in _amounts(cause) if u), default=1.0)


def _promise(
    columns: Sequence[_Column],
    precision: FloatArray,
    pull: FloatArray,
    wide: FloatArray,
    price: float,
) -> Promise | None:
    cause, label = columns[0].cause, columns[0].label
    if not _amounts(cause):  # on or off
        size = float(np.clip(pull[0] / precision[0, 0] * wide[0], 0.2, 1.5)) / wide[0]
        return Promise(
            float(pull[0] * size - 0.5 * precision[0, 0] * size**2) - price, label, cause
        )
    solved = np.linalg.solve(precision, pull)
    gain, size = 0.5 * float(pull @ solved), solved * wide
    if len({frozenset(n.parameter for n, u in _amounts(c.cause) if u) for c in columns}) > 1:
        occam = 0.5 * float(np.linalg.slogdet(precision)[1])
        return Promise(gain - occam - price, label, _together(columns, size))
    occam = 0.5 * math.log(precision[0, 0])
    total = float(size.sum())
    if total <= 0.0 and not all(n.low < 0.0 for n, _ in _amounts(cause)):
        return None
    if len(columns) > 1:
        share = float(np.clip(size[0] / total, 0.0, 1.0))
        cause = replace(cause, effect=cause.effect.with_values(modal_share=share))
    return Promise(gain - occam - price, label, times(cause, total))


def _together(columns: Sequence[_Column], sizes: FloatArray) -> Cause:
    cause = columns[0].cause
    u = [0.0 if n.amount else x
         for n, x in zip(cause.numbers, cause.coordinates(cause.effect), strict=True)]  # fmt: skip
    for column, size in zip(columns, sizes, strict=True):
        for i, (n, x) in enumerate(
            zip(cause.numbers, column.cause.coordinates(column.cause.effect), strict=True)
        ):
            if n.amount and x:
                u[i] = min(max(x * float(size), n.low), n.high)
    return replace(cause, effect=cause.at(u))


def times(cause: Cause, size: float) -> Cause:
    """A cause at so many times the amount at which it is tried.

    Args:
        cause: as it is tried.
        size: factor; beyond what a slope is believed it is cut.
    """
    factor = min(max(size, -_FARTHEST), _FARTHEST)
    u = [min(max(x * factor, n.low), n.high) if n.amount else x
         for n, x in zip(cause.numbers, cause.coordinates(cause.effect), strict=True)]  # fmt: skip
    return replace(cause, effect=cause.at(u))
