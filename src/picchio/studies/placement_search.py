"""The search behind `placement`: placements all over, their scores, what is near and beside."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.studies.placement_choice import choose, cost_tables
from picchio.studies.placement_loads import Loads
from picchio.studies.placement_reach import Candidates, Reach
from picchio.studies.placement_spot import Spot
from picchio.studies.placement_work import Work
from picchio.studies.self_collision import SelfCollision
from picchio.studies.spread import spread_evenly

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
        self.reach = Reach(self.loads.robot, self.work)

    def explore(
        self,
        half: FloatArray,
        periods: Sequence[float | None],
        wanted: int,
        seed: int,
        tell: Callable[[int], object],
    ) -> list[Spot]:
        """Placements all over, with poses from all over; those within reach, best first.

        Half of what is allowed is often out of reach, or nearly all of it: placements are drawn
        on four scales about the start, until enough of them are within reach.
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
        """
        damage, used = cost_tables(self.work, self.loads, candidates, period)
        share = self.work.share
        result: list[Spot | None] = []
        for b, move in enumerate(candidates.moves):
            while True:
                spot, pick = choose(share, b, move, period, candidates, damage, used)
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
        seeds = [pose[None, self.reach.chain.index] for pose in spot.poses]
        return len(self.reach.candidates(moves, seeds).moves) == len(moves)

    def beside(self, spot: Spot, off: float) -> list[Spot | None]:
        """The work `off` m beside a spot along each of `SHIFTS`, the robot on the same branch."""
        moves = spot.move + np.pad(off * SHIFTS, ((0, 0), (0, 1)))
        seeds = [pose[None, self.reach.chain.index] for pose in spot.poses]
        found: list[Spot | None] = []
        for move in moves:
            scores = self.score(self.reach.candidates(move[None], seeds), spot.period)
            found.append(scores[0] if scores else None)
        return found
