"""How fits are compared: by BIC, and by how sure it is, pose by pose, that one is better."""

from __future__ import annotations

import math

import numpy as np

from picchio.diagnosis.percussion.fit.drawn import hidden_cost
from picchio.diagnosis.percussion.fit.least_squares import Fit
from picchio.model.effects.effect import Effect

# Sets whose BIC is within this cannot be told apart.
SAME = 10.0
_DECISIVE = 60.0
_CHANCE = 2.0


def bic(found: Fit) -> float:
    """BIC: chi-square and priors, plus ln(samples) for every number the causes hold.

    What numbers drawn anew in every record cost is in `drawn_cost`.
    """
    causes = found.hypothesis.causes
    numbers = sum(_numbers(effect) for effect in causes)
    hidden = hidden_cost(found.hypothesis, len(found.records), found.samples)
    return found.cost + numbers * math.log(max(found.samples, 2)) + hidden


def _numbers(effect: Effect) -> int:
    return 1 if effect.latent is not None or effect.discrete else len(effect.parameters)


def confidence(better: Fit, other: Fit) -> float:
    """That a fit is better than another one of the same records.

    From the differences of the poses' scores and their spread (Student's t). A single pose has no
    spread: what it says counts only where it decides beyond doubt on its own.

    Args:
        better: the one with less left.
        other: the rival.
    """
    from scipy.stats import t as student

    poses = sorted({r.pose for r in better.records})
    difference = np.zeros(len(poses))
    for record, a, b in zip(better.records, better.residuals, other.residuals, strict=True):
        difference[poses.index(record.pose)] += float((b * b).sum() - (a * a).sum())
    if len(poses) < 2:
        return 1.0 if difference.sum() > _DECISIVE else 0.5
    # A pose that decides beyond doubt on its own counts as one: how far beyond says nothing.
    difference = np.clip(difference, -_DECISIVE, _DECISIVE)
    total, spread = difference.mean(), difference.std(ddof=1) / math.sqrt(len(poses))
    # What chance alone moves a pose's score by: that of log-likelihoods a few units apart.
    spread = math.hypot(spread, _CHANCE / math.sqrt(len(poses)))
    return float(student.cdf(total / spread, len(poses) - 1))
