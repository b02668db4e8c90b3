"""What no model has: a remainder of unknown size in each group of records, integrated out.

A group's residual of squared length c, whitened, over N samples with a signal of power S is noise
and a remainder of relative size s, spread over D numbers: with v = 1 + s^2 S / D

    p(c | s) ~ exp(-(c - N + D) / (2 v) - (D / 2) log v),

s half-normal. Far from the truth this acts like Student's t: what is never exact is not strained
by what it cannot explain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

SIZE = 0.005
"""Of the signal: one standard deviation of what a good model of a robot leaves."""
FREEDOM = 30
"""Numbers in which a record's remainder shows: as many as an arm's answer has."""
_GRID = np.concatenate([[0.0], np.geomspace(1e-4, 3.0, 120)])
_LOG_PRIOR = -0.5 * (_GRID / SIZE) ** 2 + np.log(np.gradient(_GRID)) - np.log(SIZE)


@dataclass(frozen=True)
class Left:
    """What a group's residual says of it.

    Attributes:
        log_likelihood: nats.
        weight: the mean of 1 / v: by how much less the residual counts.
        size: the residual beyond the noise, of the signal.
    """

    log_likelihood: float
    weight: float
    size: float


def left(square: float, samples: int, signal: float, records: int) -> Left:
    """The likelihood of a group with its remainder integrated out.

    Args:
        square: sum of squares of the residual, in units of the noise.
        samples: how many.
        signal: sum of squares of what was measured, in units of the noise.
        records: of the group.
    """
    freedom = FREEDOM * records
    variance = 1.0 + _GRID**2 * signal / max(freedom, 1)
    log = -0.5 * (square - samples + freedom) / variance - 0.5 * freedom * np.log(variance)
    log = log + _LOG_PRIOR
    most = float(log.max())
    weights = np.exp(log - most)
    total = float(weights.sum())
    weights /= total
    return Left(
        most + float(np.log(total)) - 0.5 * (samples - freedom),
        float(weights @ (1.0 / variance)),
        math.sqrt(max(square - samples, 0.0) / signal) if signal else 0.0,
    )
