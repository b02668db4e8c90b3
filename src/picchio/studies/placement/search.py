"""The search behind `placement`: placements all over, their scores, what is near and beside."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.robot.ik.inverse_kinematics import spread_evenly
from picchio.studies.placement.loads import Loads
from picchio.studies.placement.reach import Candidates, Reach
from picchio.studies.placement.self_collision import SelfCollision
from picchio.studies.placement.work import Work

# One placement of the work, and which of two is better.


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
        """Whether the life is longer; or, where it is the same, the utilisation lower.

        Args:
            other: another spot; any is better than None.
            by: least gain, as a share.
        """
        if other is None:
            return True
        if self.damage != other.damage:
            return self.damage < other.damage * (1.0 - by)
        return self.utilisation < other.utilisation * (1.0 - by)


_SWEEPS = 3


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


_BATCH = 64
# Placements drawn for one that is wanted within reach, and on how many scales.
_DRAWS = 20
_SCALES = 4
SHIFTS = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])


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
        reach: the poses that reach a placement.
    """

    work: Work
    loads: Loads
    collision: SelfCollision | None = None
    margin: float = 0.0
    tried: int = 0
    reached: int = 0
    nearby: int = 0
    reach: Reach = field(init=False)

    def __post_init__(self) -> None:
        self.reach = Reach(self.loads.model.robot, self.work)

    def explore(
        self,
        half: FloatArray,
        periods: Sequence[float | None],
        wanted: int,
        seed: int,
        tell: Callable[[int], object],
    ) -> list[Spot]:
        """The placements within reach, best first, drawn all over with poses from all over.

        Half of what is allowed is often out of reach, or nearly all of it: placements are drawn
        on four scales about the start, until enough of them are within reach.

        Args:
            half: (4,) half widths of what is allowed: m, m, m, rad.
            periods: s, of the blows; None for the task's own.
            wanted: how many placements within reach.
            seed: of the random numbers.
            tell: called with the number found so far.
        """
        everywhere = self.reach.everywhere(seed=seed)
        own = self.work.pose[:, self.reach.chain.index]
        seeds = [np.vstack([own[k : k + 1], everywhere]) for k in range(len(own))]
        found: list[Spot] = []
        draws = 2.0 * spread_evenly(_DRAWS * wanted, 4, seed) - 1.0
        draws *= 0.5 ** (np.arange(len(draws)) % _SCALES)[:, None]
        moves = np.vstack([np.zeros(4), draws * half]) if half.any() else np.zeros((1, 4))
        for first in range(0, len(moves), _BATCH):
            candidates = self.reach.candidates(moves[first : first + _BATCH], seeds)
            self.tried += len(moves[first : first + _BATCH])
            self.reached += len(candidates.moves)
            for period in periods:
                found += [spot for spot in self.score(candidates, period) if spot is not None]
            tell(min(self.reached, wanted))
            if self.reached >= wanted:
                break
        found.sort(key=lambda spot: (spot.damage, spot.utilisation))
        return found

    def score(
        self, candidates: Candidates, period: float | None, beat: Spot | None = None
    ) -> list[Spot | None]:
        """The best poses at each placement, and what they cost; None where a place has none.

        With `beat`, a placement that looks better is checked for self-collisions, and poses that
        collide are struck out until it is free or no better; without the margin it is dropped.

        Args:
            candidates: poses of placements.
            period: s, of the blows; None for the task's own.
            beat: the spot to be bettered.
        """
        damage, used = self.costs(candidates, period)
        result: list[Spot | None] = []
        for b in range(len(candidates.moves)):
            while True:
                spot, pick = self._choose(candidates, b, period, damage, used)
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

    def costs(
        self, candidates: Candidates, period: float | None, *, compiled: bool = True
    ) -> tuple[FloatArray, FloatArray]:
        """What candidates cost each of the n joints.

        Args:
            candidates: the poses, c of them for each of k rivet places at b placements.
            period: s, of the blows, or None.
            compiled: as in `Loads.at`.

        Returns:
            damage and utilisation, each (k, b, c, n); infinite where there is no pose.
        """
        work = self.work
        n = len(self.loads.joints)
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
            cost = self.loads.at(int(operation), stacked[there], along, period, compiled=compiled)
            for table, values in zip((damage, used), cost, strict=True):
                own = np.full((*there.shape, n), np.inf)
                own[there] = np.where(np.isfinite(values), values, np.inf)
                table[places] = own
        return damage, used

    def _choose(
        self,
        candidates: Candidates,
        b: int,
        period: float | None,
        damage: FloatArray,
        used: FloatArray,
    ) -> tuple[Spot | None, FloatArray]:
        """The best pose of every rivet place at placement b, and which candidates they are.

        `damage` and `used` are as of `costs`. The spot is None where a place has no pose.
        """
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
            np.array(candidates.moves[b]),
            period,
            np.array([candidates.poses[k][b, pick[k]] for k in rows]),
            float(total.max()),
            float(worst_used[rows, pick].max()),
        )
        return spot, pick

    def colliding(self, poses: FloatArray) -> list[int]:
        """Which of the poses have links that touch.

        Args:
            poses: (p, nv) rad or m.
        """
        check = self.collision
        return [] if check is None else [k for k, q in enumerate(poses) if check.collides(q)]

    def _has_room(self, spot: Spot) -> bool:
        """Whether every rivet is reached with the work beside, by the margin, every way."""
        moves = spot.move + np.pad(self.margin * SHIFTS, ((0, 0), (0, 1)))
        seeds = [pose[None, self.reach.chain.index] for pose in spot.poses]
        return len(self.reach.candidates(moves, seeds).moves) == len(moves)

    def beside(self, spot: Spot, off: float) -> list[Spot | None]:
        """The spots where the work lies `off` m beside a spot, along each of `SHIFTS`; same branch.

        Args:
            spot: in the middle.
            off: m.
        """
        moves = spot.move + np.pad(off * SHIFTS, ((0, 0), (0, 1)))
        seeds = [pose[None, self.reach.chain.index] for pose in spot.poses]
        found: list[Spot | None] = []
        for move in moves:
            scores = self.score(self.reach.candidates(move[None], seeds), spot.period)
            found.append(scores[0] if scores else None)
        return found


# The local half of the placement search: a pattern search on the move, the period and the poses.
#
# The largest of several joints' values has kinks, at which gradients stop; here the steps along the
# axes are joined by as many in other directions, new each time. Redundant arms try poses shaken
# along their self-motion at the same time: each rivet place takes its best on its own.

ROUNDS = 60
_SMALLEST = 2e-4
_SHAKEN = 4


def descend(
    search: Search,
    start: Spot,
    step: FloatArray,
    half: FloatArray,
    periods: tuple[float, float] | None,
    rng: np.random.Generator,
    tell: Callable[[int], object] = lambda done: None,
) -> Spot:
    """The best placement near a start.

    Args:
        search: candidates and scores.
        start: where to begin.
        step: (4,) first steps, m and rad; zero for what stays.
        half: (4,) how far the work may move in all, m and rad.
        periods: s, lowest and highest, or None.
        rng: for the directions beside the axes.
        tell: called with the number of each round, at most `ROUNDS`.

    Returns:
        a spot that is at least as good, free of self-collisions if the start is.
    """
    best = start
    free = np.flatnonzero(step > 0.0)
    shrink = 1.0
    for number in range(ROUNDS):
        if shrink < _SMALLEST:
            break
        tell(number)
        moves = _trials(best.move, step * shrink, half, free, rng)
        seeds = _shaken(search, best, min(shrink, 1.0), rng)
        candidates = search.reach.candidates(moves, seeds)
        search.nearby += len(moves)
        found = search.score(candidates, best.period, best)
        if periods is not None and best.period is not None:
            width = 0.25 * (periods[1] - periods[0]) * shrink
            for period in np.clip([best.period - width, best.period + width], *periods):
                found += search.score(candidates, float(period), best)
        better = [s for s in found if s is not None and s.better_than(best, 1e-7)]
        if better:
            best = min(better, key=lambda s: (s.damage, s.utilisation))
            shrink = min(1.0, shrink * 1.5)
        else:
            shrink *= 0.5
    return best


def _trials(
    centre: FloatArray,
    step: FloatArray,
    half: FloatArray,
    free: FloatArray,
    rng: np.random.Generator,
) -> FloatArray:
    """The centre, a step along every axis both ways, and as many in other directions."""
    axes = np.diag(step)[free]
    steps = [np.zeros(4), *axes, *-axes]
    for _ in range(2 * len(free)):
        one = rng.normal(size=4)
        steps.append(one / np.linalg.norm(one[free]) * step)
    return np.unique(np.clip(centre + np.array(steps), -half, half), axis=0)


def _shaken(
    search: Search, best: Spot, shrink: float, rng: np.random.Generator
) -> list[FloatArray]:
    """First guesses around the best poses; the solver brings them back to the tool's place."""
    index = search.reach.chain.index
    own = best.poses[:, index]
    count = _SHAKEN if search.reach.redundant else 0
    noise = rng.normal(size=(count, len(own), len(index))) * max(0.5 * shrink, 1e-3)
    return [np.vstack([own[k : k + 1], own[k] + noise[:, k]]) for k in range(len(own))]
