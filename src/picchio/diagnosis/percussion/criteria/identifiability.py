"""Identifiability: how far a parameter may move before the data show it."""

from __future__ import annotations

import numpy as np

from picchio.core.errors import InputError
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.fit.least_squares import Fit

# First move, in typical sizes or e-folds; and how often the way between two moves is halved.
_FAR = 0.5
_HALVINGS = 4


def unconstrained_range(problem: Problem, found: Fit, number: int) -> float:
    """How far an unknown may be moved, away from its nearer bound, before chi-square changes by 1.

    A rotor of next to no inertia, a damper of next to nothing: their slopes are rounding, and would
    pass for knowledge.

    Args:
        problem: data and noise.
        found: the fit.
        number: of the unknown.

    Returns:
        the signed move in the unknown's own coordinate; 0 where one by half a typical size, or half
        an e-fold, is seen.
    """
    unknown, vector = found.hypothesis.unknowns()[number], found.hypothesis.vector()
    below, above = float(vector[number]) - unknown.lower, unknown.upper - float(vector[number])
    inwards, room = (1.0, above) if below < above else (-1.0, below)

    def seen(far: float) -> bool:
        moved = vector.copy()
        moved[number] += inwards * far
        try:
            there = problem.residuals(found.hypothesis.at(moved).effects, found.records, found.end)
        except InputError:  # leads to where there is no model
            return True
        both = zip(there, found.residuals, strict=True)
        with np.errstate(all="ignore"):
            return not sum(float(((a - b) ** 2).sum()) for a, b in both) < 1.0

    low, high = 0.0, min(_FAR, room)
    while not seen(high):
        if high >= room:
            return inwards * room
        low, high = high, min(2.0 * high, room)
    if low == 0.0:
        return 0.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if seen(middle) else (middle, high)
    return inwards * high
