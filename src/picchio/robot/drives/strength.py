"""What a drive probably bears: rated, repeated-peak and momentary torque, where nobody says.

The effort limit of a joint (from the URDF, else predicted with the stiffness from inertias, weight,
levers and speed) lies somewhere between its reducer's rated torque and the limit for repeated
peaks: makers choose it so, and none says where. The catalogues tell how far apart the two are. So
the logarithm of repeated-peak torque over effort limit is taken as normal, with the two ends one
standard deviation from its middle. Half of its variance is a maker's habit, common to all joints of
a robot. Both are judgements: no pair of a joint's effort limit and its reducer was found but one
(KUKA KR 10, 2.1 to 2.2 for HFUC-40).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from picchio.robot.drives.reducer import Reducer, all_reducers

Array = NDArray[np.float64]

# No drive of a slide was measured, nor a pair of its limits read: taken as twice as uncertain.
_SLIDES = 2.0
# How much of the variance is common to a robot's joints: nobody published enough pairs to tell.
_COMMON = 0.5


@dataclass(frozen=True)
class TorqueRatios:
    """How the torques of reducers are correlated, medians of the catalogues.

    Attributes:
        peak_over_rated: limit for repeated peaks over rated torque.
        rated_spread: 1, a factor: how far that scatters.
        momentary_over_peak: limit for emergencies over that for repeated peaks.
    """

    peak_over_rated: float
    rated_spread: float
    momentary_over_peak: float


@cache
def torque_ratios(kind: str | None = None) -> TorqueRatios:
    """Of one class of reducers, or of all.

    Args:
        kind: a class of the catalogues; one that has no reducers there counts as any.
    """
    every = list(all_reducers().values())
    own = [reducer for reducer in every if reducer.kind == kind] or every
    classes = {reducer.kind for reducer in own}
    weights = np.array([1.0 / sum(r.kind == k.kind for r in own) for k in own]) / len(classes)
    peak = np.log([r.repeated_peak_torque / r.rated_torque for r in own])
    momentary = np.log([r.momentary_peak_torque / r.repeated_peak_torque for r in own])
    middle = float(weights @ peak)
    spread = math.sqrt(float(weights @ (peak - middle) ** 2))
    return TorqueRatios(math.exp(middle), math.exp(spread), math.exp(float(weights @ momentary)))


def peak_over_effort(joints: int, kind: str | None = None) -> tuple[float, Array]:
    """The logarithm of repeated-peak torque over effort limit: its mean and covariance (n, n).

    Args:
        joints: n, of one robot.
        kind: class of its reducers, or None.
    """
    half = 0.5 * math.log(torque_ratios(kind).peak_over_rated)
    return half, half**2 * (_COMMON * np.ones((joints, joints)) + (1.0 - _COMMON) * np.eye(joints))


def rated_torque(peak: float, kind: str | None, reducer: Reducer | None) -> tuple[float, float]:
    """The rated torque that goes with a repeated-peak torque, N m, and its own spread, a factor.

    Args:
        peak: N m.
        kind: class of the reducer, or None.
        reducer: if it is known.
    """
    if reducer is not None:
        return reducer.rated_torque, 1.0
    ratios = torque_ratios(kind)
    return peak / ratios.peak_over_rated, ratios.rated_spread


def slide_strength(effort: float) -> tuple[float, float]:
    """What the drive of a slide probably bears, by its effort limit alone.

    As of a reducer: the effort limit lies between what counts as rated and the limit for repeated
    peaks; but twice as uncertain, a judgement. A ball screw or a rack mostly bears more than its
    motor can give, a belt may not.

    Args:
        effort: N, positive.

    Returns:
        N, the median of the limit for repeated peaks, and its spread, a factor.
    """
    half = 0.5 * math.log(torque_ratios().peak_over_rated)
    return effort * math.exp(half), math.exp(_SLIDES * half)
