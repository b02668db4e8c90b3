"""A record's own inexact numbers, sought blow by blow where the campaign's steps leave it behind.

Where the motion has kinks a small error early is a large one late. What the campaign shares and
what fits its unknowns are found from the records that are fitted; a record held out, or one that
went another way at its third blow, then stays behind with slopes that say nothing of it. Its own
numbers (its blows, its direction, its modes' damping) are few, and what comes later changes nothing
earlier: so they are found from the first blow on, one blow more at a time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.workers import worker_pool
from picchio.diagnosis.attempt import trials
from picchio.diagnosis.percussion.data.problem import MeasuredRecord, Problem, residual_under
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.tolerance.nudges import POSE, nudged
from picchio.diagnosis.percussion.tolerance.slopes import own_slopes, starts

# Standard deviations of noise's mean square beyond which a record is left behind.
_BEHIND = 6.0
# ... and how many times what is left of the others, the median.
_FARTHER = 3.0
# Numbers are moved by so many standard deviations at most.
FARTHEST = 3.5
# Chi-square per sample, up to a blow, above which more is wrong than a record's own numbers.
_NOT_ITS_OWN = 10.0
# How many other ways past a kink are tried in a record, all in all.
_OTHERS = 16
# How often numbers are moved by slopes of their own up to a blow, how much a step is damped, and
# what fall of chi-square is worth one step more.
_MOVES = 4
_DAMPINGS = (0.0, 0.01, 0.1, 1.0, 10.0, 100.0)
_WORTH = 5.0


def left_behind(problem: Problem, here: Hypothesis) -> list[MeasuredRecord]:
    """Records of which a hypothesis leaves more than noise, whatever is not exact; see `behind`.

    Args:
        problem: linearised about the hypothesis.
        here: the hypothesis.

    Returns:
        of the campaign's, fitted or held out.
    """
    return behind(problem.records, problem.residuals(here.effects))


def behind(records: Sequence[MeasuredRecord], left: Sequence[FloatArray]) -> list[MeasuredRecord]:
    """Records of which more than noise is left, and much more than of most others.

    Where as much is left of all of them, something else is wrong.

    Args:
        records: any.
        left: (channels, m) each, in units of the noise.

    Returns:
        of these.
    """
    usual = float(np.median([(rows**2).mean() - 1.0 for rows in left]))
    return [
        record
        for record, rows in zip(records, left, strict=True)
        if _excess(rows) > _BEHIND and (rows**2).mean() - 1.0 > _FARTHER * usual
    ]


def sought_alone(
    problem: Problem, here: Hypothesis, records: Sequence[MeasuredRecord]
) -> dict[str, FloatArray]:
    """Where the own inexact numbers of some records are, each sought by itself.

    Args:
        problem: linearised about the hypothesis.
        here: the hypothesis; it stays, and so does what the campaign shares.
        records: whose numbers.

    Returns:
        (columns,) standard deviations, as in `problem.sizes`, of each record that fits better so.
    """

    def sought(name: str) -> FloatArray | None:
        record = next(r for r in records if r.name == name)
        return _blow_by_blow(problem, here, record)

    with (
        problem.pinned(here.effects),
        worker_pool(problem.workers, trials({"numbers of a record": sought})) as mapped,
    ):
        found = mapped("numbers of a record", [record.name for record in records])
    pairs = zip(records, found, strict=True)
    return {record.name: size for record, size in pairs if size is not None}


def _excess(rows: FloatArray) -> float:
    """By how many standard deviations of its noise a sum of squares is above what noise has."""
    return (float((rows**2).sum()) - rows.size) / math.sqrt(2.0 * max(rows.size, 1))


def _blow_by_blow(problem: Problem, here: Hypothesis, record: MeasuredRecord) -> FloatArray | None:
    """(columns,) its numbers; None where they are no better than those it has."""
    alone = _Alone(problem, here, record)
    before = alone.size
    alone.follow(_ends(record))
    return alone.size if alone.cost(alone.size, None) < alone.cost(before, None) else None


def _ends(record: MeasuredRecord) -> list[float | None]:
    """Up to when a record is looked at: a blow more at a time, then what follows the last one."""
    first, *later = starts(record)
    last, whole = later[-1] if later else first, record.setup.samples.times[-1]
    step = (last - first) / len(later) if later else whole
    ends = later[1:]
    while last + step < whole:
        last += step
        step *= 2.0
        ends.append(last)
    return [*ends, None]


class _Alone:
    """A record's own numbers, and what they leave of it.

    Args:
        problem: linearised about the hypothesis.
        here: the hypothesis.
        record: one of the campaign's.
    """

    def __init__(self, problem: Problem, here: Hypothesis, record: MeasuredRecord) -> None:
        assert problem.marginal is not None
        self._problem, self._here, self._record = problem, here, record
        self._slopes = problem.marginal.slopes[record.name]
        self._model = problem.model.with_effects(here.effects)
        self._poses = problem.marginal.only(POSE)
        # Where the robot stands stays where it is told, where slopes serve for that.
        self._stays = np.array(
            [one.where == POSE and not self._slopes.silent for one in self._slopes.what],
            dtype=bool,
        )[: self._slopes.own]
        none = np.zeros(self._slopes.columns.shape[2])
        self.size = problem.sizes.get(record.name, none)
        # What the numbers may be off by as far as is known: at first, what is stated.
        self._scatter = np.diag(np.where(self._stays, 0.0, 1.0))

    def left(self, size: FloatArray | None = None, end: float | None = None) -> FloatArray:
        """(channels, m) what the numbers leave, in units of the noise, the pose integrated out."""
        rows = self._raw(self.size if size is None else size, end)
        if not math.isfinite(float(rows.sum())):
            return rows
        return self._poses.whitened([rows], [self._record.name])[0]

    def cost(self, size: FloatArray, end: float | None) -> float:
        """Chi-square and what the numbers cost; infinite where the motion diverges."""
        total = float((self.left(size, end) ** 2).sum())
        held = float((size[: self._slopes.own] ** 2).sum())
        return total + held if math.isfinite(total) else math.inf

    def follow(self, ends: Sequence[float | None]) -> None:
        """Move the numbers up to one end after the other, as long as they explain what is seen.

        Past a kink that they just miss, no step leads on from where they are: then others are tried
        that explain what came before as well, drawn by how well that tells them.
        """
        others, rng, explained = _OTHERS, np.random.default_rng(0), False
        for end in ends:
            start, scatter = self.size, self._scatter
            self.move(end)
            while explained and others and not self.explains(end):
                others -= 1
                best, cost = (self.size, self._scatter), self.cost(self.size, end)
                self.size = self._off(start, scatter @ rng.standard_normal(len(scatter)))
                self.move(end)
                if self.cost(self.size, end) > cost:
                    self.size, self._scatter = best
            if (self.left(end=end) ** 2).mean() > _NOT_ITS_OWN:
                return
            explained = self.explains(end)

    def explains(self, end: float | None) -> bool:
        """Whether no more than noise is left up to an end."""
        return _excess(self.left(end=end)) <= _BEHIND

    def move(self, end: float | None) -> None:
        """Move the numbers by Gauss and Newton's steps, by what they do up to some time."""
        cost, own = self.cost(self.size, end), self._slopes.own
        for _ in range(_MOVES):
            columns = own_slopes(self._problem, self._record, self._here.effects, self.size, end)
            flat = columns.reshape(-1, own).astype(float)
            normal = flat.T @ flat + np.eye(own)
            free = np.ix_(~self._stays, ~self._stays)
            self._scatter = np.zeros((own, own))
            self._scatter[free] = np.linalg.inv(np.linalg.cholesky(normal[free])).T
            held = np.where(self._stays, 0.0, self.size[:own])
            right = flat.T @ self._raw(self.size, end).ravel() + held
            before = cost
            for damping in _DAMPINGS:
                step = -np.linalg.solve(normal + damping * np.diag(np.diag(normal)), right)
                other = self._off(self.size, np.where(self._stays, 0.0, step))
                now = self.cost(other, end)
                if now < before:
                    self.size, cost = other, now
                    break
            if before - cost < _WORTH:
                return

    def _off(self, size: FloatArray, step: FloatArray) -> FloatArray:
        """Numbers that are off by a step of its own, as far as they may be."""
        other = np.array(size)
        other[: step.size] = np.clip(other[: step.size] + step, -FARTHEST, FARTHEST)
        return other

    def _raw(self, size: FloatArray, end: float | None) -> FloatArray:
        there, more = nudged(self._record, self._slopes.moved(size))
        with np.errstate(all="ignore"):
            return residual_under(self._record, self._model, there, more, end)
