"""How much a model leaves, and how much a right one may."""

from __future__ import annotations

import numpy as np

from picchio.diagnosis.evidence.estimate import Fit

LEFT = 0.01
"""Of the signal: what a model that is right may leave, the contract's allowed remainder."""


def left_by(fit: Fit) -> float:
    """Relative size of what a fit leaves, root mean square over the groups that have records.

    Args:
        fit: of a set of causes.

    Returns:
        1 is as much as was measured.
    """
    there = np.unique(fit.likelihood.group_of)
    return float(np.sqrt(np.mean(fit.objective.sizes[there] ** 2)))
