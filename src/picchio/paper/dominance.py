"""A search for worlds in which the joints dominate as Fig. 9 has it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.paper.assumptions import INPUTS
from picchio.paper.study import Study
from picchio.paper.world import World

_TRIED = 4000
_NAMES = ("period", "duty", "damping_ratio", "path_x")


@dataclass(frozen=True, eq=False)
class Dominance:
    """What the search found.

    Attributes:
        tried: worlds; hits: those with the paper's sequence.
        values: (tried, 4) of period, duty, damping ratio, x of the path.
        agree: (tried,) how many of the four heights agree.
        example: a world with the sequence, the one farthest from losing it; None if there is none.
        margin: by how much the example's dominant joints lead, at the closest height.
    """

    tried: int
    hits: int
    values: FloatArray
    agree: FloatArray
    example: World | None
    margin: float

    @property
    def words(self) -> str:
        """The condition."""
        if self.example is None:
            return ""
        given = self.example.given
        return (
            f"several inputs match, for instance T = {1e3 * given.period:.3g} ms, "
            f"Td/T = {given.duty:.2g}, damping ratio {given.damping_ratio:.2g}, "
            f"x = {given.path_x:.3g} m, elbow {given.elbow}, inertias about the "
            f"{given.inertia_about}; there the closest of the four leads by "
            f"{100 * self.margin:.2g} %"
        )


@lru_cache(maxsize=1)
def search_dominance(study: Study) -> Dominance:
    """Random worlds on the vertical path, with the study's seed; kept for the last study."""
    rng = np.random.default_rng(study.seed)
    wanted = np.array(study.printed.task.dominant_joints) - 1
    entries = {entry.name: entry for entry in INPUTS}
    values = np.empty((_TRIED, len(_NAMES)))
    agree = np.empty(_TRIED)
    best: tuple[float, World | None] = (-1.0, None)
    frames = [
        study.given.but(inertia_about=about, elbow=elbow)
        for about in ("cg", "joint")
        for elbow in ("down", "up")
    ]
    for k in range(_TRIED):
        changes = {name: entries[name].at(rng.random()) for name in _NAMES}
        world = World(frames[rng.integers(len(frames))].but(**changes))
        peaks = world.path_peaks.peak_deflection
        values[k] = list(changes.values())
        same = peaks.argmax(axis=1) == wanted
        agree[k] = same.sum()
        if same.all():
            ordered = np.sort(peaks, axis=1)
            margin = float((ordered[:, -1] / ordered[:, -2]).min() - 1.0)
            if margin > best[0]:
                best = (margin, world)
    hits = int((agree == len(wanted)).sum())
    return Dominance(_TRIED, hits, values, agree, best[1], best[0])
