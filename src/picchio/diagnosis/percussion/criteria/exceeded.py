"""Whether what is never exact is where its tolerances allow, all in all."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.fit.least_squares import Fit

# Numbers of which the records know less than this share are where they are stated.
_KNOWN = 0.2
# A campaign with nothing hidden is further off than this once in ten thousand.
_IMPROBABLE = 1e-4
# What a fit leaves beyond noise is taken to sit in so many numbers of each pose: a few of every
# mode, seen in a few channels.
_PER_POSE = 12
# The excess that noise alone leaves, standard deviations.
_CHANCE = 3.0
_TOLD = 3


@dataclass(frozen=True)
class Exceeded:
    """How far a campaign's shared numbers are from where they are stated.

    Attributes:
        probability: that tolerances alone would put them as far off.
        farthest: the names of the numbers, and where they are, in standard deviations, the most
            telling first.
    """

    probability: float
    farthest: tuple[tuple[str, float], ...]

    @property
    def improbable(self) -> bool:
        """Whether tolerances do not explain it."""
        return self.probability < _IMPROBABLE

    def told(self) -> str:
        """What would have to be off, and by how much."""
        said = ", ".join(f"{name} by {abs(size):.1f}" for name, size in self.farthest[:_TOLD])
        return f"it could be explained only by tolerances exceeded several times: {said}"


def exceeded(problem: Problem, found: Fit) -> Exceeded | None:
    """How far off what the campaign shares is in a fit; None where everything is exact.

    The quadratic form of the estimates and their covariance under the tolerances is distributed as
    chi-square (Mahalanobis, 1936); what a remainder does to the estimates is allowed for.

    Args:
        problem: data and noise, linearised about the fit.
        found: the fit.
    """
    from scipy.stats import chi2

    marginal = problem.marginal
    if marginal is None or not marginal.shared:
        return None
    names = [record.name for record in found.records]
    poses = len({record.pose for record in found.records})
    chance = _CHANCE * math.sqrt(2.0 * found.samples)
    excess = max(found.chi_square - found.samples - chance, 0.0)
    raw = problem.unmarginalised(found.hypothesis.effects, found.records)
    where, covariance = marginal.shared_estimate(
        raw,
        names,
        1.0 + excess / (_PER_POSE * poses),
        (effect.label for effect in found.hypothesis.effects),
    )
    spread = np.eye(len(where)) - covariance
    values, vectors = np.linalg.eigh(spread)
    known = values > _KNOWN
    if not known.any():
        return None
    form = float((((vectors.T @ where)[known]) ** 2 / values[known]).sum())
    alone = np.sqrt(np.maximum(spread.diagonal(), _KNOWN))
    order = np.argsort(-np.abs(where / alone))
    farthest = tuple((marginal.shared[k], float(where[k])) for k in order)
    return Exceeded(float(chi2.sf(form, int(known.sum()))), farthest)
