"""Least squares stretch by stretch: each is judged by what the others say."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.diagnosis.motion.data.system import Group, Segment
from picchio.diagnosis.motion.fit.least_squares import stable_solve, stable_solves

_TINY = 1e-300


@dataclass
class Block:
    """Normal equations of a group's rows in one stretch of a record."""

    group: Group
    block: int
    rows: int
    normal: FloatArray
    right: FloatArray
    power: float


@dataclass(frozen=True, eq=False)
class Stretch:
    """One stretch of a segment, with the base's columns that are not nothing there.

    Attributes:
        group: of the segment.
        number: which stretch of which record.
        rows: of the system.
        columns: (t,) which.
        left: (m, t) those columns.
        normal: (t, t) left^T left.
    """

    group: Group
    number: int
    rows: slice
    columns: np.ndarray
    left: FloatArray
    normal: FloatArray

    def block(self, index: np.ndarray, added: FloatArray, right: FloatArray) -> Block:
        """Normal equations.

        Args:
            index: of the base's columns, ascending: those that are asked for.
            added: (rows, c) more columns, of the whole system.
            right: (rows,) what all shall make up, of the whole system.
        """
        place = np.searchsorted(index, self.columns)
        here = (place < index.size) & (index[np.minimum(place, index.size - 1)] == self.columns) \
            if index.size else np.zeros(self.columns.size, dtype=bool)  # fmt: skip
        place, y, more = place[here], right[self.rows], added[self.rows]
        size = index.size + more.shape[1]
        normal, target = np.zeros((size, size)), np.zeros(size)
        normal[np.ix_(place, place)] = self.normal[np.ix_(here, here)]
        target[place] = (y @ self.left)[here]
        if np.any(more):
            cross = (more.T @ self.left)[:, here]
            normal[index.size :, place] = cross
            normal[place, index.size :] = cross.T
            normal[index.size :, index.size :] = more.T @ more
            target[index.size :] = y @ more
        return Block(self.group, self.number, y.size, normal, target, float(y @ y))


def stretches_of(s: Segment, block: np.ndarray, left: FloatArray) -> list[Stretch]:
    """A segment's stretches.

    Args:
        s: the segment.
        block: (rows,) the stretch of every row of the system.
        left: (rows, k) the base's columns.
    """
    columns = np.flatnonzero(np.any(left[s.rows], axis=0))
    touched, number = np.ascontiguousarray(left[s.rows][:, columns]), block[s.rows]
    edges = np.flatnonzero(np.diff(number)) + 1
    found = []
    for start, end in zip(np.append(0, edges), np.append(edges, number.size), strict=True):
        x = touched[start:end]
        rows = slice(s.rows.start + int(start), s.rows.start + int(end))
        found.append(Stretch(s.group, int(number[start]), rows, columns, x, x.T @ x))
    return found


def without_added(b: Block, count: int) -> Block:
    """A block's first `count` columns alone."""
    return Block(b.group, b.block, b.rows, b.normal[:count, :count], b.right[:count], b.power)


@dataclass
class Validated:
    """A solution, and what it leaves.

    Attributes:
        solution: of all rows.
        inside: group -> power that it leaves.
        outside: (group, stretch) -> power left there by the solution of all other stretches.
        count: (group, stretch) -> rows.
        own: the largest part of an added column that the others can't make up.
    """

    solution: FloatArray
    inside: Mapping[Group, float]
    outside: Mapping[tuple[Group, int], float]
    count: Mapping[tuple[Group, int], int]
    own: float


def cross_validate(
    blocks: list[Block],
    elsewhere: tuple[FloatArray, FloatArray],
    prior: FloatArray,
    pull: FloatArray,
    base: int,
) -> Validated:
    """Solve with all stretches, and with each left out.

    Args:
        blocks: of at least one stretch.
        elsewhere: normal equations that other groups add for the first `base` columns.
        prior: (columns,) precision of each, of the added ones, too.
        pull: (columns,) towards its centre.
        base: how many columns are not added ones.
    """
    normals = np.array([b.normal for b in blocks])
    rights = np.array([b.right for b in blocks])
    power = np.array([b.power for b in blocks])
    normal, right = normals.sum(axis=0), rights.sum(axis=0)
    normal[:base, :base] += elsewhere[0]
    right[:base] += elsewhere[1]
    normal += np.diag(prior)
    right += pull
    solution = stable_solve(normal, right)
    # Every stretch is left out in turn, with all groups' equations in it.
    numbers, stretch = np.unique([b.block for b in blocks], return_inverse=True)
    member = (stretch == np.arange(numbers.size)[:, None]).astype(np.float64)
    fewer = normal - np.tensordot(member, normals, 1)
    others = stable_solves(fewer, right - member @ rights)[stretch]
    here = _left(power, normals, rights, np.broadcast_to(solution, others.shape))
    there = _left(power, normals, rights, others)
    inside: dict[Group, float] = {}
    outside: dict[tuple[Group, int], float] = {}
    count: dict[tuple[Group, int], int] = {}
    for b, own, foreign in zip(blocks, here.tolist(), there.tolist(), strict=True):
        place = (b.group, b.block)
        inside[b.group] = inside.get(b.group, 0.0) + own
        outside[place] = outside.get(place, 0.0) + foreign
        count[place] = count.get(place, 0) + b.rows
    return Validated(solution, inside, outside, count, _own(normal, base))


def _own(normal: FloatArray, count: int) -> float:
    """The largest part of an added column that the others can't make up: 0 where all can."""
    if count == normal.shape[0]:
        return 1.0
    a, b, c = normal[:count, :count], normal[:count, count:], normal[count:, count:]
    made = np.column_stack([stable_solve(a, column) for column in b.T]) if count else b
    left = np.diag(c - b.T @ made) if count else np.diag(c)
    return float(np.max(left / np.maximum(np.diag(c), _TINY)))


def _left(power: FloatArray, normal: FloatArray, right: FloatArray,
          solution: FloatArray) -> FloatArray:  # fmt: skip
    """(n,) power that solutions leave, each in its stretch."""
    half = (normal @ solution[:, :, None])[:, :, 0] - 2.0 * right
    return np.asarray(np.maximum(0.0, power + np.sum(solution * half, axis=1)))


def confidence(differences: FloatArray) -> float:
    """That the mean of score differences is above zero (Student)."""
    from scipy.stats import t

    n = differences.size
    if n < 2:
        return 0.5
    spread = float(differences.std(ddof=1)) / np.sqrt(n)
    mean = float(differences.mean())
    if spread == 0.0:
        return 1.0 if mean > 0.0 else 0.0 if mean < 0.0 else 0.5
    return float(t.cdf(mean / spread, n - 1))
