"""Normal equations of a campaign: numbers of records, then of groups, are eliminated.

What is left is a small system in what the whole campaign shares (nested Schur complements; Triggs
et al., Bundle adjustment - a modern synthesis (2000), section 6, doi:10.1007/3-540-44480-7_21).
All numbers are in units of their prior standard deviation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from picchio.core.arrays import FloatArray
from picchio.diagnosis.evidence.numbers import Numbers


@dataclass(frozen=True, eq=False)
class Reduced:
    """The system in what the campaign shares.

    Attributes:
        precision: (n, n) of the shared numbers, the others integrated out.
        pull: (n,) the gradient.
        log_determinant: of what was eliminated.
        groups, records: how the eliminated numbers follow.
    """

    precision: FloatArray
    pull: FloatArray
    log_determinant: float
    groups: tuple[FloatArray, ...]
    records: tuple[tuple[int, int, FloatArray], ...]

    def back(self, shared: FloatArray) -> Numbers:
        """The step of all numbers that belongs to one of the shared ones.

        Args:
            shared: (n,) the step.
        """
        own = tuple(k[:, -1] - k[:, :-1] @ shared for k in self.groups)
        out: dict[int, FloatArray] = {}
        for record, group, k in self.records:
            out[record] = k[:, -1] - k[:, :-1] @ np.concatenate([own[group], shared])
        return Numbers(shared, own, tuple(out[r] for r in sorted(out)))


def reduce(
    grams: Sequence[FloatArray],
    group_of: Sequence[int],
    weights: FloatArray,
    at: Numbers,
) -> Reduced:
    """Eliminate what belongs to records and groups.

    Args:
        grams: of each record (k, k): products of its columns, in the order record's numbers,
            group's, shared, residual.
        group_of: of each record.
        weights: (groups,) by which their residuals count.
        at: where the numbers are, in units of their prior.

    Returns:
        the reduced system; a step adds to `at`.
    """
    n = at.shared.size
    precision, pull, log_det = np.eye(n), -at.shared.copy(), 0.0
    groups, records = [], []
    for group, there in enumerate(at.groups):
        m = there.size
        inner = np.zeros((m + n + 1, m + n + 1))
        for record in np.flatnonzero(np.asarray(group_of) == group).tolist():
            gram, k = weights[group] * grams[record], at.records[record].size
            if k:
                own = gram[:k, :k] + np.eye(k)
                cross = gram[:k, k:].copy()
                cross[:, -1] -= at.records[record]
                factor = cho_factor(own)
                solved = cho_solve(factor, cross)
                inner += gram[k:, k:] - cross.T @ solved
                log_det += 2.0 * float(np.log(np.diag(factor[0])).sum())
            else:
                solved = np.zeros((0, m + n + 1))
                inner += gram
            records.append((record, group, solved))
        if m:
            own = inner[:m, :m] + np.eye(m)
            cross = inner[:m, m:].copy()
            cross[:, -1] -= there
            factor = cho_factor(own)
            solved = cho_solve(factor, cross)
            inner = inner[m:, m:] - cross.T @ solved
            log_det += 2.0 * float(np.log(np.diag(factor[0])).sum())
        else:
            solved = np.zeros((0, n + 1))
        precision += inner[:-1, :-1]
        pull += inner[:-1, -1]
        groups.append(solved)
    return Reduced(precision, pull, log_det, tuple(groups), tuple(records))


def bounded(reduced: Reduced, low: FloatArray, high: FloatArray) -> FloatArray:
    """The shared step of least cost within bounds, by an active set.

    Args:
        reduced: the system.
        low: (n,) least step.
        high: (n,) largest step.
    """
    a, b = reduced.precision, reduced.pull
    step = np.linalg.solve(a, b)
    held = np.zeros(b.size, bool)
    for _ in range(b.size):
        out = (step < low - 1e-12) | (step > high + 1e-12)
        if not (out & ~held).any():
            break
        held |= out
        step[held] = np.clip(step[held], low[held], high[held])
        free = ~held
        right = b[free] - a[np.ix_(free, held)] @ step[held]
        step[free] = np.linalg.solve(a[np.ix_(free, free)], right)
    return np.clip(step, low, high)


def left_of(gram: FloatArray, step: FloatArray) -> float:
    """Sum of squares of a record's residual after a step of (own, group, shared) numbers.

    Args:
        gram: (k + 1, k + 1) products of its columns and residual.
        step: (k,) of its numbers.

    Returns:
        the sum of squares.
    """
    whole = np.append(-step, 1.0)
    return float(whole @ gram @ whole)
