"""Equivalence: how fits are compared, and when one explanation is as good as another.

By BIC, and by how sure it is, pose by pose, that one is better. BIC takes every number to be known
the better, the more samples there are; but numbers that few records say nothing of cost nothing:
what they leave open is no reason to drop a cause.
"""

from __future__ import annotations

import math
from collections.abc import Sequence, Set

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.diagnosis.percussion.criteria.identifiability import unconstrained_range
from picchio.diagnosis.percussion.data.problem import MeasuredRecord, Problem
from picchio.diagnosis.percussion.fit.drawn import hidden_cost
from picchio.diagnosis.percussion.fit.least_squares import Fit, fit
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.model.effects.effect import Effect
from picchio.model.effects.registry import effect_class

# Sets whose BIC is within this cannot be told apart.
SAME = 10.0
_DECISIVE = 60.0
_CHANCE = 2.0
# As many poses as are needed to do without the one that says most for, and most against.
_MANY = 5
_PARALLEL = 1.0 - 1e-9
# What is known of a cause's number beforehand, in typical sizes or e-folds: hardly anything.
_VAGUE = 3.0


def bic(found: Fit) -> float:
    """BIC: chi-square and priors, plus ln(samples) for every number the causes hold.

    What numbers drawn anew in every record cost is in `drawn_cost`.
    """
    numbers = count_numbers(found.hypothesis)
    hidden = hidden_cost(found.hypothesis, len(found.records), found.samples)
    return found.cost + numbers * math.log(max(found.samples, 2)) + hidden


def count_numbers(hypothesis: Hypothesis) -> int:
    """How many numbers its causes hold.

    Args:
        hypothesis: whose.
    """
    return sum(_numbers(effect) for effect in hypothesis.causes)


def _numbers(effect: Effect) -> int:
    return 1 if effect.latent is not None or effect.discrete else len(effect.fitted)


def confidence(better: Fit, other: Fit) -> float:
    """That a fit is better than another one of the same records.

    From the differences of the poses' scores and their spread (Student's t). A single pose has no
    spread: what it says counts only where it decides beyond doubt on its own. Of five or more no
    single one decides against what all the others but the one that says most agree on. What is
    known beforehand of numbers that all poses share, such as a tolerance, belongs to none of them.

    Args:
        better: the one with less left.
        other: the rival.
    """
    poses = sorted({r.pose for r in better.records})
    difference = np.zeros(len(poses))
    for record, a, b in zip(better.records, _by_record(better), _by_record(other), strict=True):
        difference[poses.index(record.pose)] += b - a
    known = (other.cost - other.chi_square) - (better.cost - better.chi_square)
    difference += known / len(poses)
    if len(poses) < 2:
        return 1.0 if difference.sum() > _DECISIVE else 0.5
    # A pose that decides beyond doubt on its own counts as one: how far beyond says nothing.
    difference = np.clip(difference, -_DECISIVE, _DECISIVE)
    sure = _positive(difference)
    if len(poses) >= _MANY:
        sure = max(sure, _positive(np.sort(difference)[1:-1]))
    return sure


def _by_record(found: Fit) -> FloatArray:
    if found.by_record is not None:
        return found.by_record
    return np.array([float((rows * rows).sum()) for rows in found.residuals])


def _positive(values: FloatArray) -> float:
    """How sure it is that the mean of what values are drawn from is above nothing."""
    from scipy.stats import t as student

    spread = values.std(ddof=1) / math.sqrt(values.size)
    # What chance alone moves a pose's score by: that of log-likelihoods a few units apart.
    spread = math.hypot(spread, _CHANCE / math.sqrt(values.size))
    return float(student.cdf(values.mean() / spread, values.size - 1))


def bic_difference(problem: Problem, best: Fit, other: Fit) -> float:
    """How much higher a fit's BIC is, numbers counted as far as the records determine them.

    Args:
        problem: data and noise.
        best: the one that is claimed.
        other: its rival, fitted to the same records.
    """
    by_bic, by_cost = bic(other) - bic(best), other.cost - best.cost
    if by_bic < SAME or by_cost >= SAME:
        return by_bic
    if _in_series(best.hypothesis.labels ^ other.hypothesis.labels, best.records):
        # The base's spring has a damper of its own, the joint's shares the robot's damping: that
        # is told in more numbers, but fits nothing that the joint does not.
        return by_cost
    told = [_effective_parameters(problem, each) for each in (best, other)]
    return by_cost + (told[1] - told[0]) * math.log(max(best.samples, 2))


def _in_series(labels: Set[str], records: Sequence[MeasuredRecord]) -> bool:
    """Whether these are a joint's stiffness and a base that moves the tool as the joint does."""
    pairs = [label.split(":", 1) for label in labels]
    springs = [effect_class(name).yields_along(target) for name, target in pairs]
    if len(springs) != 2 or not all(springs):
        return False
    for geometry in {record.setup.geometry for record in records}:
        jacobian = geometry.motion(geometry.robot.tool_point).jacobian
        a, b = (jacobian[:, geometry.chain.coordinates.index(name)] for name in springs)
        if abs(a @ b) < _PARALLEL * np.linalg.norm(a) * np.linalg.norm(b):
            return False
    return True


def _effective_parameters(problem: Problem, found: Fit) -> float:
    """How many of the causes' numbers the records determine, beside the nuisances.

    The trace of what data add to next to nothing (D. J. C. MacKay, Neural Computation 4 (1992)
    415, doi:10.1162/neco.1992.4.3.415).
    """
    if found.jacobians is None:
        found = fit(
            problem, found.hypothesis, found.records, None, iterations=0, with_jacobian=True
        )
    free = np.array([u.prior is None for u in found.hypothesis.unknowns()])
    at_work = ~free
    at_work[free] = [not unconstrained_range(problem, found, int(k)) for k in np.flatnonzero(free)]
    free = free[at_work]
    matrix = found.normal_matrix()[np.ix_(at_work, at_work)] + np.diag(free / _VAGUE**2)
    left = np.linalg.pinv(matrix, hermitian=True)[np.ix_(free, free)]
    return float(np.clip(1.0 - np.linalg.eigvalsh(left) / _VAGUE**2, 0.0, 1.0).sum())
