"""Whether an effect of a fit is needed, and whether a candidate may be claimed."""

from __future__ import annotations

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.diagnosis.motion.criteria.score import Score, Scorer
from picchio.diagnosis.motion.fit.least_squares import Fit
from picchio.diagnosis.motion.fit.stretches import confidence

_LEAST_BIC = 3.0
_LEAST_CONFIDENCE = 0.90
_LEAST_SHARE = 0.005
_TIE = 2.0
_SURE = 0.95


def passes(score: Score, ripple: bool = False) -> bool:
    """Whether a candidate may be claimed: penalised, held out, and on every stretch."""
    enough = ripple or score.share >= _LEAST_SHARE
    return (
        score.admissible and score.bic > _LEAST_BIC and score.gain > 0.0
        and score.confidence >= _LEAST_CONFIDENCE and enough
    )  # fmt: skip


def necessity(scorer: Scorer, index: int) -> Score | None:
    """What an effect of the scorer's fit gains over the fit without it."""
    current = scorer.base
    own, part = contribution(current, index)
    if not own:
        return None
    coordinates = [current.coordinates[i] for i in own]
    columns = current.columns[:, own]
    values = np.array([c.value for c in coordinates])
    noise = scorer.noise_of(current.state.effects[index])
    return scorer.score(columns, coordinates, values - part, without=own, back=columns @ part,
                        noise=noise)  # fmt: skip


def contribution(current: Fit, index: int) -> tuple[list[int], FloatArray]:
    """An effect's coordinates, and how far each is from where it does nothing.

    At the optimum the residual is what the full model leaves: with the effect's own part (its
    columns times these) added back, a fit without it has to leave it.
    """
    number = len(current.state.nuisances) + index
    own = [i for i, c in enumerate(current.coordinates) if c.index == number]
    return own, np.array([_from_neutral(current, i) for i in own])


def _from_neutral(current: Fit, i: int) -> float:
    """How far a linear parameter is from where it does nothing; others count as they are."""
    c = current.coordinates[i]
    effect = current.state.every[c.index]
    parameter = next(p for p in effect.parameters if p.name == c.name)
    if parameter.name == "order" or parameter.logarithmic:
        return c.value if c.name in effect.inverse else 0.0
    return c.value - parameter.neutral


def indistinguishable(score: Score, other: Score) -> bool:
    """Whether a rival is nearly as likely, or loses in no clear majority of the stretches."""
    if other.rank >= score.rank - _TIE:
        return True
    shared = sorted(set(score.differences) | set(other.differences))
    lead = np.array([
        score.differences.get(b, 0.0) - other.differences.get(b, 0.0) for b in shared
    ])  # fmt: skip
    return confidence(lead) < _SURE and float(lead.sum()) < 3.0 * _TIE
