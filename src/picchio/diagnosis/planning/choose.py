"""Which records to take: those that narrow the outcome most for the time that they take.

The outcome's variance after the tests is linear in nothing, but each record's gain is closed: with
the numbers' covariance S at a drawn robot, the record's slopes A (over the readings' deviations)
and the outcome's slope g, it is (A S g)^T (A S A^T + I)^-1 (A S g), in the mean over robots drawn
from what is known before (Bayesian design for one function of the numbers: Chaloner and
Verdinelli, Stat. Sci. 10 (1995) 273, doi:10.1214/ss/1177009939). One record after the other is
taken; where it is taken matters, and what is set up already costs no time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from picchio.core.arrays import FloatArray
from picchio.diagnosis.planning.kind import Offered, Possible
from picchio.diagnosis.planning.outcome import Outcome

WORTH = 0.005
"""A record that narrows the outcome's deviation by less than this share changes no answer."""


@dataclass(frozen=True, eq=False)
class Chosen:
    """A record to take.

    Attributes:
        candidate: which.
        seconds: that it takes, with what must be set up for it.
        deviation: of the outcome by stiffness and damping, once it is taken.
    """

    candidate: Possible
    seconds: float
    deviation: float


@dataclass(frozen=True, eq=False)
class Choice:
    """What to do, in the order of the gains.

    Attributes:
        records: to take.
        before: deviation of the outcome by stiffness and damping, without them.
        covariance: (s, 2 n, 2 n) of the numbers, expected after them.
        why: it ends there.
    """

    records: tuple[Chosen, ...]
    before: float
    covariance: FloatArray
    why: str

    @property
    def after(self) -> float:
        """The deviation that is left."""
        return self.records[-1].deviation if self.records else self.before


def choose(
    outcome: Outcome, kinds: Sequence[Offered], budget: float, *, most: int | None = None,
    worth: float = WORTH,
) -> Choice:  # fmt: skip
    """Take records one after the other, by their gain and by their gain for the time.

    Args:
        outcome: to be narrowed.
        kinds: what could be taken.
        budget: s.
        most: records; no bound if None.
        worth: the least gain of a record, a share of the outcome's deviation.

    Returns:
        the records of the way that narrows it more, and what is expected after them.
    """
    ways = [_taken(outcome, kinds, budget, most, worth, timed) for timed in (True, False)]
    return min(ways, key=lambda way: way.after)


def _taken(
    outcome: Outcome, kinds: Sequence[Offered], budget: float, most: int | None, worth: float,
    timed: bool,
) -> Choice:  # fmt: skip
    """Take the best record, again and again: for its time, or for itself."""
    space = Space.of(outcome, kinds)
    candidates = [one for kind in kinds for one in kind.each]
    seconds = [kind.test.seconds for kind in kinds for _ in kind.each]
    least = {kind.test.name: kind.test.least for kind in kinds}
    free = np.ones(len(candidates), dtype=bool)
    ready: set[tuple[object, ...]] = set()
    records: list[Chosen] = []
    spent, left = 0.0, space.variance
    before = math.sqrt(left)
    why = f"that is all: {len(candidates)} records could be taken"
    while free.any():
        if most is not None and len(records) >= most:
            why = f"{most} records were asked for"
            break
        cost = np.array([
            record + (0.0 if (one.place,) in ready else pose)
            + (0.0 if (one.place, *one.setting) in ready else setup)
            for one, (pose, setup, record) in zip(candidates, seconds, strict=True)
        ])  # fmt: skip
        within = free & (spent + cost <= budget)
        if not within.any():
            why = "the time is up"
            break
        gain = space.gains()
        taken = [one.candidate.kind for one in records]
        few = {name for name in taken if taken.count(name) < least[name]}
        if few:
            within &= np.array([one.kind in few for one in candidates])
            if not within.any():
                why = "the time is up"
                break
        best = int(np.where(within, gain / cost if timed else gain, -np.inf).argmax())
        total = left + outcome.rest
        small = total <= 0.0 or math.sqrt(max(1.0 - gain[best] / total, 0.0)) > 1.0 - worth
        if small and not few:
            why = (f"one more record would narrow the interval by less than {100 * worth:.2g} %"
                   if total > 0.0 else "nothing is uncertain")  # fmt: skip
            break
        space.take(best)
        left = space.variance
        one = candidates[best]
        ready |= {(one.place,), (one.place, *one.setting)}
        free[best] = False
        spent += cost[best]
        records.append(Chosen(one, float(cost[best]), math.sqrt(left)))
    return Choice(tuple(records), before, space.known, why)


class Space:
    """The covariance of all numbers at the drawn robots, as records are taken.

    Args:
        outcome: whose slopes count.
        covariance: (s, p, p) before them.
        slopes: (c, s, r, p) of the candidates, zeros where one has fewer readings.
    """

    def __init__(self, outcome: Outcome, covariance: FloatArray, slopes: FloatArray) -> None:
        self.outcome, self.covariance, self.slopes = outcome, covariance, slopes
        self.toward = np.zeros((*outcome.slope.shape[:2], covariance.shape[-1]))
        self.toward[..., : outcome.slope.shape[-1]] = outcome.slope

    @classmethod
    def of(cls, outcome: Outcome, kinds: Sequence[Offered]) -> Space:
        """Before any record; numbers of one name are one in all kinds of tests.

        Args:
            outcome: whose slopes count.
            kinds: of records.

        Returns:
            with the numbers of all kinds, stiffness and damping first.
        """
        core = outcome.slope.shape[-1]
        names = list(dict.fromkeys(name for kind in kinds for name in kind.names))
        most = max(kind.slopes.shape[2] for kind in kinds)
        parts = []
        for kind in kinds:
            c, s, r, _ = kind.slopes.shape
            own = np.zeros((c, s, most, core + len(names)))
            columns = [*range(core), *(core + names.index(name) for name in kind.names)]
            own[:, :, :r, columns] = kind.slopes
            parts.append(own)
        whole = block_diag(outcome.covariance, np.eye(len(names)))
        start = np.tile(whole, (len(outcome.at), 1, 1))
        return cls(outcome, start, np.concatenate(parts))

    @property
    def known(self) -> FloatArray:
        """(s, 2 n, 2 n) covariance of stiffness and damping."""
        core = self.outcome.slope.shape[-1]
        return self.covariance[:, :core, :core]

    @property
    def variance(self) -> float:
        """Of the outcome."""
        return self.outcome.variance(self.known)

    def gains(self) -> FloatArray:
        """(c,) by how much each record would lower the variance."""
        through = np.einsum("csrp,spq->csrq", self.slopes, self.covariance, optimize=True)
        spread = np.einsum("csrq,cstq->csrt", through, self.slopes, optimize=True)
        spread += np.eye(spread.shape[-1])
        side = np.einsum("csrq,sgq->csrg", through, self.toward, optimize=True)
        return np.asarray((side * np.linalg.solve(spread, side)).sum(axis=2).mean(axis=(1, 2)))

    def take(self, index: int) -> None:
        """Condition on a record.

        Args:
            index: which.
        """
        slope = self.slopes[index]
        through = slope @ self.covariance
        spread = through @ slope.swapaxes(1, 2) + np.eye(slope.shape[1])
        less = through.swapaxes(1, 2) @ np.linalg.solve(spread, through)
        self.covariance = self.covariance - 0.5 * (less + less.swapaxes(1, 2))
