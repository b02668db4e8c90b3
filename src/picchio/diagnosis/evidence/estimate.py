"""The most probable numbers of a hypothesis, and the evidence for it.

Gauss-Newton on minus the log posterior, residuals from the full model, slopes from its
linearisation; the evidence by Laplace's approximation, its determinant in units of the prior.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.diagnosis.evidence.arrow import Reduced, bounded, left_of, reduce
from picchio.diagnosis.evidence.numbers import Numbers
from picchio.diagnosis.evidence.remainder import left

FAILED = (InputError, np.linalg.LinAlgError, FloatingPointError)
"""What may happen where there is no model; anything else is a fault of the program."""
RENEWED = 30.0
"""nats: slopes are taken anew after a step that gained more."""


class Linear(Protocol):
    """A model linearised at a point."""

    def grams(self, residuals: Sequence[FloatArray]) -> list[FloatArray]:
        """(k, k) of each record: products of its columns and of its residual, the last.

        Args:
            residuals: whitened, of each record.
        """


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known of all numbers beforehand: independent normals within bounds."""

    mean: Numbers
    std: Numbers
    low: FloatArray
    high: FloatArray


class Likelihood(Protocol):
    """A campaign's records under one hypothesis, up to a time."""

    @property
    def prior(self) -> Prior:
        """Of all numbers."""

    @property
    def group_of(self) -> Sequence[int]:
        """The group of each record."""

    @property
    def samples(self) -> Sequence[int]:
        """Of each record, all its channels together."""

    @property
    def signal(self) -> Sequence[float]:
        """Sum of squares of what was measured in each record, in units of the noise."""

    def residuals(self, at: Numbers) -> list[FloatArray]:
        """Whitened residuals of each record.

        Args:
            at: the numbers.

        Returns:
            an array a record.

        Raises:
            InputError: no model there.
        """

    def linearised(self, at: Numbers) -> Linear:
        """The slopes there.

        Args:
            at: the numbers.
        """


@dataclass(frozen=True, eq=False)
class Objective:
    """Minus the log posterior at a point, and what it is made of."""

    value: float
    weights: FloatArray
    sizes: FloatArray
    squares: FloatArray


@dataclass(frozen=True, eq=False)
class Fit:
    """The most probable numbers of a hypothesis.

    Attributes:
        likelihood: what was fitted.
        at: the numbers.
        objective: there.
        evidence: log probability of the data, nats.
        residuals: there.
        linear: slopes near there.
        reduced: the system in what is shared.
        covariance: (n, n) of the shared numbers, in units of their prior.
        renewals: how often slopes were taken.
        grams: products of slopes and residual, in units of the prior.
    """

    likelihood: Any
    at: Numbers
    objective: Objective
    evidence: float
    residuals: list[FloatArray]
    linear: Any
    reduced: Reduced
    covariance: FloatArray
    renewals: int
    grams: list[FloatArray] = field(repr=False, default_factory=list)

    @property
    def std(self) -> FloatArray:
        """(n,) of the shared numbers."""
        found = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        return np.asarray(found * self.likelihood.prior.std.shared)


def objective(likelihood: Likelihood, at: Numbers, squares: FloatArray) -> Objective:
    """Minus the log posterior of numbers that leave so much.

    Args:
        likelihood: of the records.
        at: the numbers.
        squares: (records,) sums of squares of the residuals.

    Returns:
        its value, and what is left of each group.
    """
    away = standardised(likelihood.prior, at)
    found = grouped(likelihood, squares)
    value = 0.5 * away.square - sum(one.log_likelihood for one in found)
    return Objective(
        value,
        np.array([one.weight for one in found]),
        np.array([one.size for one in found]),
        np.bincount(likelihood.group_of, squares),
    )


def grouped(likelihood: Likelihood, squares: FloatArray) -> list[Any]:
    """What is left of each group.

    Args:
        likelihood: of the records.
        squares: (records,) sums of squares of the residuals.
    """
    of = np.asarray(likelihood.group_of)
    sums = [
        np.bincount(of, np.asarray(v, float))
        for v in (squares, likelihood.samples, likelihood.signal, np.ones(of.size))
    ]
    return [left(c, int(n), s, int(r)) for c, n, s, r in zip(*sums, strict=True)]


def standardised(prior: Prior, at: Numbers) -> Numbers:
    """Numbers in units of their prior.

    Args:
        prior: of all numbers.
        at: the numbers.
    """
    return (at + prior.mean.scaled(-1.0)) / prior.std


def scaled(grams: Sequence[FloatArray], group_of: Sequence[int], std: Numbers) -> list[FloatArray]:
    """Products of columns per standard deviation of the prior.

    Args:
        grams: of each record, in units of the numbers.
        group_of: of each record.
        std: of the prior.

    Returns:
        the same products per standard deviation.
    """
    out = []
    for record, gram in enumerate(grams):
        own = np.concatenate([std.records[record], std.groups[group_of[record]], std.shared, [1.0]])
        out.append(gram * own[:, None] * own)
    return out


def squares_of(residuals: Sequence[FloatArray]) -> FloatArray:
    """(records,) sums of squares.

    Args:
        residuals: of each record.
    """
    return np.array([float(np.vdot(rows, rows)) for rows in residuals])


def promised(
    likelihood: Likelihood, grams: Sequence[FloatArray], at: Numbers, step: Numbers
) -> FloatArray:
    """(records,) what a step leaves by the slopes, numbers in units of their prior.

    Args:
        likelihood: of the records.
        grams: in units of the prior.
        at: where the numbers are.
        step: in units of the prior.
    """
    found = []
    for record, gram in enumerate(grams):
        own = np.concatenate(
            [step.records[record], step.groups[likelihood.group_of[record]], step.shared]
        )
        found.append(left_of(gram, own))
    return np.maximum(np.array(found), 0.0)


def solve(
    likelihood: Likelihood,
    grams: Sequence[FloatArray],
    at: Numbers,
    weights: FloatArray,
    rounds: int = 3,
) -> tuple[Numbers, Reduced, float]:
    """The step of least cost by the slopes, groups' weights renewed on the way.

    Args:
        likelihood: of the records.
        grams: in units of the prior.
        at: where the numbers are.
        weights: of the groups, there.
        rounds: how often weights are renewed.

    Returns:
        the step in units of the prior, the system, and the objective that is promised.
    """
    prior = likelihood.prior
    there = standardised(prior, at)
    low = (prior.low - at.shared) / prior.std.shared
    high = (prior.high - at.shared) / prior.std.shared
    best: tuple[Numbers, Reduced, float] | None = None
    for _ in range(rounds):
        system = reduce(grams, likelihood.group_of, weights, there)
        step = system.back(bounded(system, low, high))
        squares = promised(likelihood, grams, at, step)
        told = objective(likelihood, at + step * prior.std, squares)
        if best is None or told.value < best[2]:
            best = step, system, told.value
        weights = told.weights
    assert best is not None
    return best


def estimate(
    likelihood: Likelihood,
    start: Numbers,
    *,
    renewals: int = 12,
    steps: int = 30,
    tolerance: float = 0.05,
) -> Fit:
    """The most probable numbers.

    Args:
        likelihood: of the records under a hypothesis.
        start: where to begin.
        renewals: how often slopes may be taken.
        steps: at most.
        tolerance: nats by which a step must gain.

    Raises:
        InputError: no model at the start.
    """
    prior = likelihood.prior
    at = Numbers(np.clip(start.shared, prior.low, prior.high), start.groups, start.records)
    residuals = likelihood.residuals(at)
    now = objective(likelihood, at, squares_of(residuals))
    used, fresh, linear = 0, False, None
    for _ in range(steps):
        if linear is None:
            if used >= renewals:
                break
            linear, fresh = likelihood.linearised(at), True
            used += 1
        grams = scaled(linear.grams(residuals), likelihood.group_of, prior.std)
        step, _, told = solve(likelihood, grams, at, now.weights)
        moved, gained = None, 0.0
        if now.value - told > 0.1 * tolerance:
            size = 1.0
            for _ in range(6):
                try:
                    there = at + (step * prior.std).scaled(size)
                    there = Numbers(
                        np.clip(there.shared, prior.low, prior.high), there.groups, there.records
                    )
                    left_there = likelihood.residuals(there)
                    then = objective(likelihood, there, squares_of(left_there))
                    if then.value < now.value - 1e-9:
                        moved, gained = (there, left_there, then), now.value - then.value
                        break
                except FAILED:
                    pass
                if not fresh and size < 0.3:
                    break
                size *= 0.4
        if moved is not None:
            at, residuals, now = moved
        if gained > RENEWED:
            linear = None
        elif gained < tolerance:
            if fresh or used >= renewals:
                break
            linear = None
        else:
            fresh = False
    if linear is None:
        linear = likelihood.linearised(at)
        used += 1
    return settled(likelihood, at, residuals, now, linear, used)


def settled(
    likelihood: Likelihood,
    at: Numbers,
    residuals: list[FloatArray],
    now: Objective,
    linear: Any,
    used: int,
) -> Fit:
    """A fit at its numbers: evidence and covariance.

    Args:
        likelihood: of the records.
        at: the numbers.
        residuals: there.
        now: the objective there.
        linear: slopes near there.
        used: how often slopes were taken.
    """
    prior = likelihood.prior
    grams = scaled(linear.grams(residuals), likelihood.group_of, prior.std)
    system = reduce(grams, likelihood.group_of, now.weights, standardised(prior, at))
    factor = np.linalg.cholesky(system.precision)
    log_det = system.log_determinant + 2.0 * float(np.log(np.diag(factor)).sum())
    inverse = np.linalg.inv(factor)
    return Fit(
        likelihood,
        at,
        now,
        -now.value - 0.5 * log_det,
        residuals,
        linear,
        system,
        inverse.T @ inverse,
        used,
        grams=grams,
    )
