"""What may be claimed, by the table of all sets that were fitted. Four constants decide."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from picchio.diagnosis.evidence.estimate import Fit
from picchio.diagnosis.evidence.table import Labels, Table, labels_of

CLAIM = 3.0
"""nats: odds of 20 to 1, for a claim and to leave out a rival."""
LEFT = 0.01
"""Of the signal: what a model that is right may leave, the contract's allowed remainder."""
SHARE = 0.5
"""Of what causes explain, in power: what a claim in part may leave."""


@dataclass(frozen=True, eq=False)
class Judged:
    """A verdict.

    Attributes:
        verdict: as in `picchio-diagnosis/1`.
        fit: the most probable set.
        alternatives: sets that do as well.
        left: relative size of what is left, root mean square over the groups.
        odds: nats, of any cause against none.
        confidence: of each cause, whatever else there is.
    """

    verdict: str
    fit: Fit
    alternatives: tuple[Labels, ...]
    left: float
    odds: float
    confidence: dict[str, float]


def left_by(fit: Fit) -> float:
    """Relative size of what a fit leaves, root mean square over the groups that have records.

    Args:
        fit: of a set of causes.

    Returns:
        1 is as much as was measured.
    """
    there = np.unique(fit.likelihood.group_of)
    return float(np.sqrt(np.mean(fit.objective.sizes[there] ** 2)))


def judge(table: Table) -> Judged:
    """The verdict on a table.

    Args:
        table: of all sets that were fitted, the empty one among them.
    """
    none, odds, weights = table.fits[frozenset()], table.odds(), table.weights()
    best = table.best if odds >= CLAIM else none
    own, left = labels_of(best), left_by(best)
    confidence = {label: sum(w for key, w in weights.items() if label in key) for label in own}
    rivals = tuple(key for key, _ in table.rivals(CLAIM) if key) if own else ()
    explained = left_by(none) ** 2 - left**2
    if not own:
        verdict = "nothing-wrong" if left <= LEFT else "unexplained"
    elif left <= LEFT:
        verdict = "ambiguous" if rivals else "named"
    else:
        verdict = "partial" if left**2 <= SHARE * explained else "unexplained"
    return Judged(verdict, best, rivals, left, odds, confidence)
