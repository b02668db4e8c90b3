"""How much each unreported input matters: one at a time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from picchio.core.errors import InputError
from picchio.paper.assumptions import INPUTS, Input
from picchio.paper.study import Study
from picchio.paper.waterfall import paper_lives
from picchio.paper.world import World

_STEPS = 7


@dataclass(frozen=True)
class Influence:
    """One input over its range.

    Attributes:
        name: of the input; words: with its range and unit.
        value: in the base world; tried: the values.
        lives: rivets to failure by the paper's method at the values that can be reached, the
            base world's first.
        sequences: the dominant joints of Fig. 9 that were seen, such as "2 3 3 1".
        why: what is known of it.
    """

    name: str
    words: str
    value: Any
    tried: tuple[Any, ...]
    lives: tuple[float, ...]
    sequences: tuple[str, ...]
    why: str

    @property
    def factor(self) -> float:
        """Longest over shortest life."""
        return max(self.lives) / min(self.lives)

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "value": self.value, "tried": self.tried, "lives": self.lives, "factor": self.factor,
            "dominant_joints": self.sequences, "why": self.why,
        }  # fmt: skip


@lru_cache(maxsize=1)
def influences(study: Study) -> tuple[Influence, ...]:
    """Every input, the most influential first; kept for the last study."""
    return tuple(sorted((_one(study, entry) for entry in INPUTS), key=lambda i: -i.factor))


def _one(study: Study, entry: Input) -> Influence:
    base = getattr(study.given, entry.name)
    tried, lives, sequences = [], [], []
    for value in (base, *_values(entry)):
        world = World(study.given.but(**{entry.name: value}))
        try:
            life = float(paper_lives(world).min())
        except InputError:
            continue  # a pattern out of reach
        tried.append(value)
        lives.append(life)
        try:
            leads = world.path_peaks.peak_deflection.argmax(axis=1) + 1
            sequences.append(" ".join(str(int(j)) for j in leads))
        except InputError:
            continue
    return Influence(
        entry.name, _words(entry), base, tuple(tried), tuple(lives),
        tuple(dict.fromkeys(sequences)), entry.why,
    )  # fmt: skip


def _values(entry: Input) -> list[Any]:
    if entry.choices:
        return list(entry.choices)
    found = [entry.at(share) for share in np.linspace(0.0, 1.0, _STEPS)]
    return [int(value) for value in found] if entry.name == "harmonics" else found


def _words(entry: Input) -> str:
    name = entry.name.replace("_", " ")
    if entry.choices:
        return f"{name}: " + ", ".join(str(c) for c in entry.choices)
    assert entry.low is not None
    assert entry.high is not None
    scale, unit = 1.0, entry.unit.replace("–", "")
    if unit == "Pa":
        scale, unit = 1e9, "GPa"
    elif unit == "s":
        scale, unit = 1e-3, "ms"
    low, high = entry.low / scale, entry.high / scale
    digits = 3 if math.log10(max(high, 1e-9)) < 3 else 4
    return f"{name}: {low:.{digits}g} to {high:.{digits}g} {unit}".rstrip()
