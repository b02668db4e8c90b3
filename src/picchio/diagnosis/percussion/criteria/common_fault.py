"""Faults that all sensors have alike: their origin lies before the sensors, not in them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.model.effects.effect import Effect

# Share of an effect's size within which two sensors' values are the same. Two faults that have
# nothing to do with one another come that near about once in twenty times.
_SAME = 0.05
# Standard deviations of a difference that still count as none; where they are more than a
# quarter of the size, that two values agree says nothing.
_DEVIATIONS = 3.0
_VAGUE = 0.25


def common_faults(
    found: Hypothesis, covariance: FloatArray, groups: Sequence[str]
) -> tuple[str, ...]:
    """Effects that every group of sensors has, by the same amount.

    A sensor's fault is its own. One that all of them have alike, though they are of different
    kinds, is one change before all of them: of the blows, or of the clock that they share. Through
    a linear arm a gain, a delay or a filter of all sensors is the same as one of the force, so that
    data can't tell; but then it is hardly the sensors that are broken.

    Args:
        found: with the causes' values.
        covariance: (unknowns, unknowns) of the transformed unknowns.
        groups: of the channels that were measured; fewer than two have nothing in common.
    """
    common = []
    for name in dict.fromkeys(cause.name for cause in found.causes):
        own = [cause for cause in found.causes if cause.name == name]
        if own[0].where != "sensor" or own[0].latent is not None or len(groups) < 2:
            continue
        if {cause.target for cause in own} == set(groups) and all(
            _alike(found, covariance, a, b) for a, b in pairwise(own)
        ):
            common.append(name)
    return tuple(common)


def _alike(found: Hypothesis, covariance: FloatArray, one: Effect, other: Effect) -> bool:
    """Whether two sensors have an effect by the same amount."""
    for p in one.parameters:
        a, b = one.values[p.name], other.values[p.name]
        size = abs(0.5 * (a + b) - (p.neutral if math.isfinite(p.neutral) else 0.0))
        unsure = _DEVIATIONS * _spread(found, covariance, (one, other), p.name)
        if abs(a - b) > max(_SAME * size, unsure) or unsure > _VAGUE * size:
            return False
    return True


def _spread(
    found: Hypothesis, covariance: FloatArray, pair: tuple[Effect, Effect], name: str
) -> float:
    """Standard deviation of the difference of two effects' values, which may vary together."""
    weights, vector = np.zeros(len(covariance)), found.vector()
    for k, unknown in enumerate(found.unknowns()):
        for effect, sign in zip(pair, (1.0, -1.0), strict=True):
            if found.effects[unknown.effect] is effect and unknown.name == name:
                weights[k] = sign * abs(unknown.slope(vector[k]))
    return math.sqrt(max(float(weights @ covariance @ weights), 0.0))
