"""Jacobians of residuals: by differences, from a fit nearby, or updated from step to step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.data.record import MeasuredRecord
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis, Unknown

_LEAST_STEP = 1e-7


def jacobian(
    problem: Problem,
    hypothesis: Hypothesis,
    records: Sequence[MeasuredRecord],
    end: float | None,
    at: list[FloatArray],
    steps: FloatArray | None = None,
    first: Sequence[FloatArray] | None = None,
) -> list[FloatArray]:
    """D residual / d unknowns of every record by differences, (channels x m, unknowns).

    Args:
        problem: data and noise.
        hypothesis: where.
        records: which.
        end: s.
        at: the residuals there.
        steps: (unknowns,) of the differences; the unknowns' own where None.
        first: the first columns, where they are known.
    """
    vector, unknowns = hypothesis.vector(), hypothesis.unknowns()
    columns: list[list[FloatArray]] = [[] for _ in records]
    known = first[0].shape[1] if first else 0
    for k, unknown in enumerate(unknowns[known:], start=known):
        step = unknown.step if steps is None else float(steps[k])
        if vector[k] + step > unknown.upper:
            step = -step
        moved = vector.copy()
        moved[k] += step
        try:
            there = problem.residuals(hypothesis.at(moved).effects, records, end)
        except InputError:  # no model there, such as springs that gravity overturns
            step = -step
            moved[k] = vector[k] + step
            there = problem.residuals(hypothesis.at(moved).effects, records, end)
        for i, (a, b) in enumerate(zip(there, at, strict=True)):
            columns[i].append(((a - b) / step).ravel())
    found = [
        np.stack(c, axis=1) if c else np.zeros((a.size, 0))
        for c, a in zip(columns, at, strict=True)
    ]
    if first:
        found = [np.concatenate(pair, axis=1) for pair in zip(first, found, strict=True)]
    return found


def fine_steps(parts: Sequence[FloatArray], unknowns: Sequence[Unknown]) -> FloatArray:
    """Steps that change the residuals by about two standard deviations all in all.

    The time of a blow's edge is known to a microsecond: a step of a thousandth would carry late
    edges past samples, and its difference quotient would say nothing of the slope.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # of a motion that diverges
        norms = np.sqrt(sum((part**2).sum(axis=0) for part in parts))
    norms = np.where(np.isfinite(norms), norms, np.inf)
    own = np.array([u.step for u in unknowns])
    return np.asarray(np.clip(2.0 / np.maximum(norms, 1e-12), _LEAST_STEP, own))


def borrowed(
    hypothesis: Hypothesis,
    residuals: Sequence[FloatArray],
    near: Hypothesis,
    near_slopes: Sequence[FloatArray],
    near_residuals: Sequence[FloatArray],
) -> list[FloatArray] | None:
    """The first columns of the Jacobian, from a fit nearby, cut to these residuals' length.

    None where the nearby fit's unknowns are not the first of these.
    """
    own = [(u.effect, u.name) for u in hypothesis.unknowns()]
    known = [(u.effect, u.name) for u in near.unknowns()]
    if own[: len(known)] != known:
        return None
    found = []
    for slopes, whole, part in zip(near_slopes, near_residuals, residuals, strict=True):
        channels, count = whole.shape
        shaped = slopes.reshape(channels, count, -1)[:, : part.shape[1]]
        found.append(shaped.reshape(part.size, -1))
    return found


def updated(
    slopes: Sequence[FloatArray],
    before: Sequence[FloatArray],
    after: Sequence[FloatArray],
    moved: FloatArray,
    scale: FloatArray,
) -> list[FloatArray]:
    """Broyden's update: the least change that agrees with what the step did."""
    weighted = scale**2 * moved
    along = float(moved @ weighted)
    if not along > 0.0:
        return list(slopes)
    return [
        j + np.outer((new - old).ravel() - j @ moved, weighted / along)
        for j, old, new in zip(slopes, before, after, strict=True)
    ]
