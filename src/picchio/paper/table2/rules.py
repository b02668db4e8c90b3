"""The hypotheses about Table 2: from the 15 rivets' stresses to a joint's N."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import FloatArray

Average = Callable[[FloatArray, float], FloatArray]


def at_mean(stress: FloatArray, exponent: float) -> FloatArray:
    """Every rivet counts with the mean of the peaks: what the text says. (..., rivets) in."""
    return np.zeros(stress.shape[:-1])


def by_miner(stress: FloatArray, exponent: float) -> FloatArray:
    """Each rivet counts with its own life; ln of the damage over that at the mean."""
    relative = stress / stress.mean(axis=-1, keepdims=True)
    return np.asarray(np.log((relative**exponent).mean(axis=-1)))


def at_worst(stress: FloatArray, exponent: float) -> FloatArray:
    """All rivets count like the worst one."""
    return np.asarray(exponent * np.log(stress.max(axis=-1) / stress.mean(axis=-1)))


@dataclass(frozen=True)
class Rule:
    """One hypothesis.

    Attributes:
        name: in words.
        average: how 15 rivets become one damage.
        counts: what N is divided by: 1 (hits), the hits of a rivet, or None for any factor.
        free_exponent: whether the curve's exponent is fitted, and its level with it.
        measure: stress "peak" or "range".
        inertia_about: "cg" or "joint".
    """

    name: str
    average: Average
    counts: float | None
    free_exponent: bool = False
    measure: str = "peak"
    inertia_about: str = "cg"

    @property
    def extra(self) -> int:
        """Numbers fitted beside the world's."""
        return int(self.free_exponent) + int(self.counts is None)


def rules(hits: float) -> list[Rule]:
    """The hypotheses, the paper's own words first. Add one here."""
    return [
        Rule("curve as printed, at the mean stress", at_mean, 1.0),
        Rule("rivets for hits, at the mean stress", at_mean, hits),
        Rule("rivets for hits, Miner over the rivets", by_miner, hits),
        Rule("rivets for hits, the worst rivet", at_worst, hits),
        Rule("rivets for hits, Miner, range for peak", by_miner, hits, measure="range"),
        Rule("rivets for hits, Miner, inertias about the joints", by_miner, hits,
             inertia_about="joint"),
        Rule("another exponent, Miner over the rivets", by_miner, None, free_exponent=True),
        Rule("another curve, at the mean stress", at_mean, None, free_exponent=True),
        Rule("another curve, at the mean, inertias about the joints", at_mean, None,
             free_exponent=True, inertia_about="joint"),
    ]  # fmt: skip
