"""Which causes dominate the residual: only those are claimed where more than noise is left."""

from __future__ import annotations

from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.fit.least_squares import Fit, fit, fits_without

# Nine tenths: what imitates something unknown takes away that much of it where the two are
# correlated by 0.95.
_FAR_ABOVE = 0.9


def dominant_causes(problem: Problem, found: Fit) -> Fit:
    """The fit without the causes that explain too little of what is wrong without them.

    Where the catalogue lacks something, its last causes imitate what it lacks: each takes a part
    of it away, and leaves as much. A true one stands far above that. What explains least is taken
    out first, and the others are fitted again; the last one stays.

    Args:
        problem: data and noise.
        found: the fit, with more than noise left.
    """
    best = found
    while len(best.hypothesis.labels) > 1:
        fits = fits_without(
            best, lambda rest: fit(problem, rest, found.records, None, iterations=5)
        )
        without = min(fits, key=lambda other: other.cost, default=best)
        if without is best or explained_share(best, without) >= _FAR_ABOVE:
            break
        best = without
    return best


def explained_share(best: Fit, without: Fit) -> float:
    """How much of what is wrong without a cause is explained with it: 1 where noise is left."""
    rise = max(without.cost - best.cost, 0.0)
    left = max(best.chi_square - best.samples, 0.0)
    return rise / max(rise + left, 1e-300)
