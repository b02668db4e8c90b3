"""The Bayesian information criterion, by which sets of causes are compared."""

from __future__ import annotations

import math

from picchio.diagnosis.percussion.fit.drawn import hidden_cost
from picchio.diagnosis.percussion.fit.least_squares import Fit
from picchio.model.effects.effect import Effect

# Sets whose BIC is within this cannot be told apart.
SAME = 10.0


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
