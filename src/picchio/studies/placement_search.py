"""The search behind `placement`: candidates by inverse kinematics, scores, global then local."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from picchio.core.arrays import FloatArray, IndexArray
from picchio.robot.chain import Chain, tool_chain
from picchio.robot.ik_kernel import solve_points
from picchio.robot.inverse_kinematics import TOLERANCE, tables_of
from picchio.studies.placement_loads import Loads
from picchio.studies.placement_work import Work
from picchio.studies.self_collision import SelfCollision
from picchio.studies.spread import spread_evenly

_BATCH = 64
# Placements drawn for one that is wanted within reach, and on how many scales.
_DRAWS = 20
_SCALES = 4
_SWEEPS = 3
SHIFTS = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])


@dataclass(frozen=True, eq=False)
class Spot:
    """One placement of the work, and how the robot reaches it.

    Attributes:
        move: (4,) dx, dy, dz in m, and the heading in rad.
        period: s, of the blows; None leaves every operation its own.
        poses: (k, nv) rad or m, of every rivet place.
        damage: largest joint's Miner sum of a rivet of the mix.
        utilisation: largest of all joints and places.
    """

    move: FloatArray
    period: float | None
    poses: FloatArray
    damage: float
    utilisation: float

    def better_than(self, other: Spot | None, by: float = 0.0) -> bool:
        """Whether the life is longer; or, where it is the same, the utilisation lower."""
        if other is None:
            return True
        if self.damage != other.damage:
            return self.damage < other.damage * (1.0 - by)
        return self.utilisation < other.utilisation * (1.0 - by)


@dataclass(frozen=True, eq=False)
class Candidates:
    """Poses that reach the work at b placements, c at most a rivet place; NaN where none.

    Attributes:
        moves: (b, 4), all within reach.
        poses: one array (b, c, nv) a rivet place.
    """

    moves: FloatArray
    poses: tuple[FloatArray, ...]


@dataclass(eq=False)
class Search:
    """The search on one work.

    Attributes:
        work: what is moved.
        loads: what poses cost.
        collision: refuses poses; None where there are no meshes.
        margin: m; every rivet must be reached, too, with the work so far beside along x, y or z.
        tried: placements looked at all over.
        reached: of these, the ones where every rivet can be reached.
        nearby: placements looked at near the best.
    """

    work: Work
    loads: Loads
    collision: SelfCollision | None = None
    margin: float = 0.0
    tried: int = 0
    reached: int = 0
    nearby: int = 0
    chain: Chain = field(init=False)
    _middle: FloatArray = field(init=False)
    _groups: list[IndexArray] = field(init=False)

    def __post_init__(self) -> None:
        self.chain = tool_chain(self.loads.robot)
        ends = self.chain.lower + self.chain.upper
        self._middle = np.where(np.isfinite(ends), 0.5 * ends, 0.0)
        # The outermost first: where a placement is out of reach they tell.
        groups = [np.flatnonzero(self.work.group == g) for g in np.unique(self.work.group)]
        gap = np.linalg.norm(self.work.position - self.work.centre, axis=1)
        self._groups = sorted(groups, key=lambda members: -gap[members[0]])

    @property
    def redundant(self) -> bool:
        """Whether a point (and axis) leaves the arm a motion of its own."""
        return len(self.chain.index) > (3 if self.work.axis is None else 5)

    def everywhere(self, times: int = 1, seed: int = 0) -> FloatArray:
        """First guesses (s, joints) all over the joints' ranges; angles at most once round."""
        chain, middle = self.chain, self._middle
        starts = times * (8 if len(chain.index) <= 3 else 24)
        reach = np.where(chain.wraps, np.pi, 1.0)
        lower = np.maximum(chain.lower, middle - reach)
        upper = np.minimum(chain.upper, middle + reach)
        return lower + spread_evenly(starts, len(lower), seed) * (upper - lower)

    def explore(
        self,
        half: FloatArray,
        periods: Sequence[float | None],
        wanted: int,
        seed: int,
        progress: Callable[[int, int], None] | None = None,
    ) -> list[Spot]:
        """Placements all over, with poses from all over; those within reach, best first.

        Half of what is allowed is often out of reach, or nearly all of it: placements are drawn
        on four scales about the start, until enough of them are within reach.
        """
        everywhere = self.everywhere(seed=seed)
        own = self.work.pose[:, self.chain.index]
        seeds = [np.vstack([own[k : k + 1], everywhere]) for k in range(len(own))]
        found: list[Spot] = []
        draws = 2.0 * spread_evenly(_DRAWS * wanted, 4, seed) - 1.0
        draws *= 0.5 ** (np.arange(len(draws)) % _SCALES)[:, None]
        moves = np.vstack([np.zeros(4), draws * half]) if half.any() else np.zeros((1, 4))
        for first in range(0, len(moves), _BATCH):
            candidates = self.candidates(moves[first : first + _BATCH], seeds)
            self.tried += len(moves[first : first + _BATCH])
            self.reached += len(candidates.moves)
            for period in periods:
                found += [spot for spot in self.score(candidates, period) if spot is not None]
            if progress is not None:
                progress(min(self.reached, wanted), wanted)
            if self.reached >= wanted:
                break
        found.sort(key=lambda spot: (spot.damage, spot.utilisation))
        return found

    def candidates(self, moves: FloatArray, seeds: Sequence[FloatArray]) -> Candidates:
        """Poses within the limits, of the placements where every rivet can be reached.

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
            tables_of(chain), guesses, self._middle, chain.wraps, chain.lower, chain.upper,
            targets, axes, weight, False, q, error,
        )  # fmt: skip
        q[error >= TOLERANCE] = np.nan
        _drop_twins(q)
        return q

    def score(
        self, candidates: Candidates, period: float | None, beat: Spot | None = None
    ) -> list[Spot | None]:
        """The best poses at each placement, and what they cost; None where a place has none.

        With `beat`, a placement that looks better is checked for self-collisions, and poses that
        collide are struck out until it is free or no better; without the margin it is dropped.
        """
        damage, used = self._tables(candidates, period)
        result: list[Spot | None] = []
        for b, move in enumerate(candidates.moves):
            while True:
                spot, pick = self._choose(b, move, period, candidates, damage, used)
                if spot is None or beat is None or not spot.better_than(beat):
                    break
                bad = self.colliding(spot.poses)
                if not bad:
                    if self.margin and not self._has_room(spot):
                        spot = None
                    break
                for k in bad:
                    used[k, b, pick[k]] = np.inf
            result.append(spot)
        return result

    def colliding(self, poses: FloatArray) -> list[int]:
        """Which of the poses have links that touch."""
        check = self.collision
        return [] if check is None else [k for k, q in enumerate(poses) if check.collides(q)]

    def _has_room(self, spot: Spot) -> bool:
        """Whether every rivet is reached with the work beside, by the margin, every way."""
        moves = spot.move + np.pad(self.margin * SHIFTS, ((0, 0), (0, 1)))
        seeds = [pose[None, self.chain.index] for pose in spot.poses]
        return len(self.candidates(moves, seeds).moves) == len(moves)

    def beside(self, spot: Spot, off: float) -> list[Spot | None]:
        """The work `off` m beside a spot along each of `SHIFTS`, the robot on the same branch."""
        moves = spot.move + np.pad(off * SHIFTS, ((0, 0), (0, 1)))
        seeds = [pose[None, self.chain.index] for pose in spot.poses]
        found: list[Spot | None] = []
        for move in moves:
            scores = self.score(self.candidates(move[None], seeds), spot.period)
            found.append(scores[0] if scores else None)
        return found

    def _tables(
        self, candidates: Candidates, period: float | None
    ) -> tuple[FloatArray, FloatArray]:
        """Damage and utilisation (k, b, c, n); infinite where there is no pose."""
        work = self.work
        n = len(self.loads.robot.flexible_joints)
        shape = (len(work.group), *candidates.poses[0].shape[:2], n)
        damage, used = np.full(shape, np.inf), np.full(shape, np.inf)
        for operation in np.unique(work.operation):
            places = np.flatnonzero(work.operation == operation)
            stacked = np.stack([candidates.poses[k] for k in places])
            there = ~np.isnan(stacked).any(axis=-1)
            if not there.any():
                continue
            turned = np.stack(
                [work.directions(candidates.moves, work.direction[k]) for k in places]
            )
            along = np.broadcast_to(turned[:, :, None], (*there.shape, 3))[there]
            cost = self.loads.at(int(operation), stacked[there], along, period)
            for table, values in zip((damage, used), cost, strict=True):
                own = np.full((*there.shape, n), np.inf)
                own[there] = np.where(np.isfinite(values), values, np.inf)
                table[places] = own
        return damage, used

    def _choose(
        self,
        b: int,
        move: FloatArray,
        period: float | None,
        candidates: Candidates,
        damage: FloatArray,
        used: FloatArray,
    ) -> tuple[Spot | None, FloatArray]:
        worst_used = used[:, b].max(axis=-1)
        spent = np.where(np.isfinite(worst_used), damage[:, b].max(axis=-1), np.inf)
        least = spent.min(axis=-1, keepdims=True) if spent.size else np.full((1, 1), np.inf)
        pick = np.where(spent <= least, worst_used, np.inf).argmin(axis=-1)
        rows = np.arange(len(pick))
        if not spent.size or not np.isfinite(spent[rows, pick]).all():
            return None, pick
        own = damage[:, b] * self.work.share[:, None, None]
        own[~np.isfinite(worst_used)] = np.inf
        total = own[rows, pick].sum(axis=0)
        if total.max() > 0.0:
            pick, total = _exchange(own, worst_used, pick, total)
        spot = Spot(
            np.array(move),
            period,
            np.array([candidates.poses[k][b, pick[k]] for k in rows]),
            float(total.max()),
            float(worst_used[rows, pick].max()),
        )
        return spot, pick


def _exchange(
    own: FloatArray, used: FloatArray, pick: FloatArray, total: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Another pose at a place wherever that spares the weakest joint, until none does.

    Joints share a robot: the pose that spares one may cost another, so the places' choices hang
    together through the sum.
    """
    for _ in range(_SWEEPS):
        changed = False
        for k in range(len(pick)):
            others = total - own[k, pick[k]]
            weakest = (others + own[k]).max(axis=-1)
            best = int(np.lexsort((used[k], weakest))[0])
            if weakest[best] < weakest[pick[k]] * (1.0 - 1e-12):
                pick[k], changed = best, True
                total = np.maximum(others + own[k, best], 0.0)
        total = own[np.arange(len(pick)), pick].sum(axis=0)
        if not changed:
            break
    return pick, total


def _drop_twins(q: FloatArray) -> None:
    """Of the same poses (b, c, joints) at a placement all but the first become NaN."""
    for c in range(1, q.shape[1]):
        same = (np.abs(q[:, :c] - q[:, c : c + 1]) < 1e-6).all(axis=-1).any(axis=-1)
        q[same, c] = np.nan
