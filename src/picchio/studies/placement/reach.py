"""Which of the poses that reach a rivet place is taken: least damage, then least utilisation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import FloatArray, IndexArray
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.ik.chain import Chain, tool_chain
from picchio.robot.ik.inverse_kinematics import TOLERANCE, spread_evenly, start_ranges
from picchio.robot.ik.kernel import STEPS, solve_points
from picchio.studies.placement.work import Work

# Poses that reach the work where it stands: candidates by inverse kinematics, many at once.


@dataclass(frozen=True, eq=False)
class Candidates:
    """Poses that reach the work at b placements, c at most a rivet place; NaN where none.

    Attributes:
        moves: (b, 4), all within reach.
        poses: one array (b, c, nv) a rivet place.
    """

    moves: FloatArray
    poses: tuple[FloatArray, ...]


class Reach:
    """What an arm can reach of a work, wherever that stands.

    Args:
        robot: the arm.
        work: what is moved.

    Attributes:
        work: what is moved.
        chain: the arm's joints as tables.
    """

    def __init__(self, robot: FlexibleRobot, work: Work) -> None:
        self.work = work
        self.chain: Chain = tool_chain(robot)
        self._lower, self._upper, self._middle = start_ranges(self.chain)
        # The outermost first: where a placement is out of reach they tell.
        groups: list[IndexArray] = [np.flatnonzero(work.group == g) for g in np.unique(work.group)]
        gap = np.linalg.norm(work.position - work.centre, axis=1)
        self._groups = sorted(groups, key=lambda members: -gap[members[0]])

    @property
    def redundant(self) -> bool:
        """Whether a point (and axis) leaves the arm a motion of its own."""
        return len(self.chain.index) > (3 if self.work.axis is None else 5)

    def everywhere(self, times: int = 1, seed: int = 0) -> FloatArray:
        """The first guesses (s, joints) all over the joints' ranges; at most one turn of each.

        Args:
            times: so many times as many.
            seed: of the random numbers.
        """
        joints = len(self.chain.index)
        starts = times * (8 if joints <= 3 else 24)
        share = spread_evenly(starts, joints, seed)
        return self._lower + share * (self._upper - self._lower)

    def candidates(self, moves: FloatArray, seeds: Sequence[FloatArray]) -> Candidates:
        """The poses within the limits, of the placements where every rivet can be reached.

        Args:
            moves: (b, 4) m, rad.
            seeds: first guesses (s, joints), one array of them a rivet place.
        """
        work, chain = self.work, self.chain
        alive = self._within_reach(moves)
        poses: list[FloatArray] = [np.empty(0)] * len(work.group)
        for members in self._groups:
            guesses = np.unique(np.vstack([seeds[k] for k in members]).round(9), axis=0)
            q = self._solve(int(members[0]), moves[alive], guesses)
            reached = ~np.isnan(q[:, :, 0]).all(axis=1)
            alive, q = alive[reached], q[reached]
            poses = [p[reached] if p.ndim == 3 else p for p in poses]
            for k in members:
                full = np.tile(work.pose[k], (*q.shape[:2], 1))
                full[:, :, chain.index] = q
                poses[k] = full
            if not len(alive):
                break
        most = max(p.shape[1] if p.ndim == 3 else 0 for p in poses)
        whole = []
        for p in poses:
            padded = np.full((len(alive), most, work.pose.shape[1]), np.nan)
            if len(alive):
                missing = np.asarray(np.isnan(p).any(axis=-1))
                padded[:, : p.shape[1]] = np.where(missing[..., None], np.nan, p)
            whole.append(padded)
        return Candidates(moves[alive], tuple(whole))

    def _within_reach(self, moves: FloatArray) -> FloatArray:
        """Which moves (b, 4) leave no place farther away than the arm is long."""
        if not self.chain.wraps.all():
            return np.arange(len(moves))
        far = np.zeros(len(moves))
        for members in self._groups:
            at = self.work.positions(moves, int(members[0]))
            far = np.maximum(far, np.linalg.norm(at - self.chain.offset[0], axis=1))
        return np.flatnonzero(far <= self.chain.reach * (1.0 + 1e-9))

    def _solve(self, place: int, moves: FloatArray, guesses: FloatArray) -> FloatArray:
        """Poses (b, s, joints) of one place, NaN where a guess led nowhere new."""
        work, chain = self.work, self.chain
        guesses = np.ascontiguousarray(np.clip(guesses, chain.lower, chain.upper))
        targets = work.positions(moves, place).reshape(-1, 3)
        axes, weight = np.zeros_like(targets), 0.0
        if work.axis is not None:
            axes = work.directions(moves, work.axis[place]).reshape(-1, 3)
            weight = max(0.3 * chain.reach, 1e-3)
        q = np.empty((len(moves), len(guesses), len(chain.index)))
        error = np.empty(q.shape[:2])
        solve_points(
            chain.tables, guesses, self._middle, chain.wraps, chain.lower, chain.upper,
            targets, axes, weight, False, STEPS, q, error,
        )  # fmt: skip
        q[error >= TOLERANCE] = np.nan
        _drop_twins(q)
        return q


def _drop_twins(q: FloatArray) -> None:
    """Of the same poses (b, c, joints) at a placement all but the first become NaN."""
    for c in range(1, q.shape[1]):
        same = (np.abs(q[:, :c] - q[:, c : c + 1]) < 1e-6).all(axis=-1).any(axis=-1)
        q[same, c] = np.nan
