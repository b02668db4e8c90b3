"""What is said of every joint: its interval, whether the tests tell it, and why."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from picchio.core import spoken
from picchio.core.arrays import FloatArray
from picchio.diagnosis.identified import Identified
from picchio.robot.joint import Joint

MOST_HALF = 0.15
"""Half of a 90 % interval over the value, beyond which a joint is not told."""
_KEPT = 0.9  # a spread above this share of the prior's is the prior's
_TRADES = 0.7  # a correlation beyond which two numbers trade against each other


@dataclass(frozen=True, eq=False)
class Told:
    """What the tests say of the joints' stiffness, as far as the reasons need it.

    Attributes:
        mean: (n,) logarithms over the stated values.
        covariance: (n, n) of them.
        prior: (n,) standard deviations before the tests.
        alone: (n,) standard deviations if everything else were known.
        half: standard deviations to either end of a 90 % interval.
        names: (p,) of all numbers of the most probable fit, the n joints first.
        fitted: (p, p) their covariance.
        moved: (n,) in words, which tests move each joint most; empty where none does.
        together: (n,) in words, what no such test can tell from each joint; empty for nothing.
        doubt: (n,) standard deviation of what the fits that are about as probable say.
    """

    mean: FloatArray
    covariance: FloatArray
    prior: FloatArray
    alone: FloatArray
    half: float
    names: tuple[str, ...]
    fitted: FloatArray
    moved: tuple[str, ...]
    together: tuple[str, ...]
    doubt: FloatArray


def stiffness_of(joints: Sequence[Joint], told: Told) -> list[Identified]:
    """Value, interval and reason of every joint's stiffness.

    Args:
        joints: the n flexible ones.
        told: by the tests.

    Returns:
        as many, in their order.
    """
    size = np.sqrt(np.diag(told.covariance))
    found = []
    for k, joint in enumerate(joints):
        value = joint.stiffness * math.exp(told.mean[k])
        reach = math.exp(told.half * size[k])
        low, high = value / reach, value * reach
        known = 0.5 * (high - low) <= MOST_HALF * value and size[k] < 0.5 * told.prior[k]
        found.append(Identified(value, low, high, bool(known), _why(told, k, size[k], known)))
    return found


def _why(told: Told, k: int, size: float, known: bool) -> str:
    parts = []
    reach = math.exp(told.half * size)
    half = 0.5 * (reach - 1.0 / reach)
    share = (
        f"to {100.0 * half:.2g} %"
        if half < 0.5
        else f"within a factor of {spoken.number(reach, 2)}"
    )
    if known:
        parts.append(told.moved[k] or "the tests tell it")
    elif told.doubt[k] > 0.5 * size and told.alone[k] < 0.5 * told.prior[k]:
        parts.append(f"known {share} only")
        parts.append("it depends on what else yields, which these tests leave open")
    elif size > _KEPT * told.prior[k]:
        factor = math.exp(1.645 * told.prior[k])
        parts.append(
            "no test moves it enough: it keeps what was known before, a factor of "
            f"{spoken.number(factor, 2)} either way"
        )
    else:
        parts.append(f"known {share} only")
        if told.alone[k] < 0.6 * size and (other := _partner(told, k)):
            parts.append(f"it trades against {other}")
        else:
            parts.append("the tests move it too little for their noise")
    if told.moved[k] and told.moved[k] not in parts:
        parts.append(told.moved[k])
    if told.together[k] and size <= _KEPT * told.prior[k]:
        parts.append(told.together[k])
    return "; ".join(parts)


def _partner(told: Told, k: int) -> str:
    """The number that a joint's stiffness trades against most; empty where there is none."""
    size = np.sqrt(np.diag(told.fitted))
    row = np.abs(told.fitted[k] / (size[k] * size))
    row[k] = 0.0
    other = int(row.argmax())
    return told.names[other] if row[other] > _TRADES else ""
