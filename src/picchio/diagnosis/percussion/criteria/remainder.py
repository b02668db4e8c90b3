"""The remainder: what neither causes nor tolerances explain, and how much of it is allowed.

No model of a real robot is exact, so where a campaign states tolerances a little is always left: of
the size of half a per cent of the signal, different at every pose, and alike within one. Records
then say no more against a model than their poses do, however many samples they have (a discrepancy
in the manner of Kennedy and O'Hagan, doi:10.1111/1467-9868.00294, its size integrated out). Where
everything is stated as exact nothing may be left.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.diagnosis.percussion.criteria.whiteness import Evidence
from picchio.diagnosis.percussion.data.problem import Problem, signal_power
from picchio.diagnosis.percussion.fit.least_squares import Fit
from picchio.diagnosis.percussion.fit.unknowns import FITTED

# Of the signal, RMS: what is left of an honest model; above that something is wrong.
ALLOWED = 0.01
# Its usual size: the standard deviation of a half-normal distribution; and sizes to integrate over.
USUAL = 0.005
# ... and how many of these a remainder is at most.
_FARTHEST = 5.0
_SIZES = np.geomspace(1e-5, 10.0, 300)
# Variances of what is left, in units of the noise's, beside which what is not exact is sought.
_TEMPERS = np.geomspace(1.0, 1e6, 7)
# Of the power of what the causes explain: what a named cause may leave, and a partial one.
_NAMED = 0.1
_PARTIAL = 0.5
# Of the power that was left, what causes explain at the least that are claimed in part.
LEAST_EXPLAINED = 1.0 / (1.0 + _PARTIAL)


@dataclass(frozen=True)
class Remainder:
    """What a fit leaves beside noise and tolerance.

    Attributes:
        excess: chi-square beyond that of noise.
        signal: sum of squares of the signal, in units of the noise.
    """

    excess: float
    signal: float

    @classmethod
    def of(cls, found: Fit, evidence: Evidence) -> Remainder:
        """What a fit leaves.

        Args:
            found: the fit; its records' signals count.
            evidence: of what it leaves, by band: what stands out in one is left, even if all
                together are less than the noise was taken for.
        """
        signal = signal_power(found.records)
        excess = max(found.chi_square - found.samples, evidence.excess, 0.0)
        return cls(excess, max(signal, 1e-300))

    @property
    def nrmse(self) -> float:
        """Relative to the signal, RMS."""
        return math.sqrt(self.excess / self.signal)

    @property
    def within_tolerance(self) -> bool:
        """Whether an honest model may leave as much."""
        return self.nrmse <= ALLOWED

    @property
    def is_plausible(self) -> bool:
        """Whether it may be a remainder at all, and not another cause that is not known."""
        return self.nrmse <= _FARTHEST * USUAL

    def share_of(self, before: Remainder) -> float:
        """Its power relative to that of what was explained since.

        Args:
            before: what was left without the causes.
        """
        return self.excess / max(before.excess - self.excess, 1e-300)

    def may_be_named(self, before: Remainder) -> bool:
        """Whether causes that leave this may be named: little of what they explain, and little.

        Args:
            before: what was left without them.
        """
        return self.within_tolerance and self.share_of(before) <= _NAMED

    def may_be_partial(self, before: Remainder, follows: bool = False) -> bool:
        """Whether causes that leave this may be claimed in part.

        Args:
            before: what was left without them.
            follows: whether one of them has a number for every blow: those follow much of whatever
                disturbs the blows, so that no more may be left than of a cause that is named.
        """
        return self.share_of(before) <= (_NAMED if follows else _PARTIAL)


def allowed(problem: Problem) -> bool:
    """Whether anything may be left: where all but what is fitted is stated as exact, nothing may.

    Args:
        problem: its campaign's tolerances.
    """
    return problem.campaign.tolerance.beyond(FITTED)


def decisive_gain(without: Fit, found: Fit) -> float:
    """By how much a fit beats another one, in units of chi-square, with a remainder in both.

    The remainder's size is integrated out: what is left counts by its poses while an honest model
    may leave it, and in full beyond.

    Args:
        without: the fit that lacks something.
        found: the fit that has it.
    """
    both = without.held is not None and found.held is not None
    return _evidence_against(without, both) - _evidence_against(found, both)


def _evidence_against(found: Fit, with_held: bool) -> float:
    """Minus twice the logarithm of the likelihood of a fit, the remainder integrated out."""
    costs = np.array([(residual**2).sum() for residual in found.residuals])
    samples = np.array([residual.size for residual in found.residuals])
    # What is known beforehand counts in full: no remainder makes it any likelier.
    held = found.held if with_held and found.held is not None else 0.0
    known = held + found.cost - float(costs.sum())
    return known + _evidence_of_poses(found, costs - held * samples / samples.sum())


def tempered_evidence(problem: Problem, found: Fit) -> float:
    """As `decisive_gain` has it, where what is not exact would be absurdly far off.

    It then comes no nearer to where it is stated than the remainder leaves it: the two are sought
    together. That a model leaves less since slopes have been followed to where they say nothing
    speaks neither for it nor against it.

    Args:
        problem: linearised about the fit.
        found: the fit.

    Returns:
        minus twice the logarithm of the likelihood.
    """
    known = found.cost - found.chi_square
    tried = []
    for temper in _TEMPERS:
        taken = problem.taken_up(found.hypothesis.effects, found.records, temper)
        left = found.residuals if taken is None else taken.left
        held = 0.0 if taken is None else taken.held
        costs = np.array([(rows**2).sum() for rows in left])
        tried.append(known + held + _evidence_of_poses(found, costs))
    return min(tried)


def _evidence_of_poses(found: Fit, costs: FloatArray) -> float:
    """Minus twice the logarithm of the likelihood of what is left of records, (records,).

    A pose's share of the signal that is left is normal about nothing, its variance that of the
    remainder and of what noise leaves open; the remainder's size is half-normal.
    """
    by_pose: dict[int, FloatArray] = {}
    for record, residual, left in zip(found.records, found.residuals, costs, strict=True):
        own = np.array([left, residual.size, signal_power([record], found.end)])
        by_pose[record.pose] = by_pose.get(record.pose, np.zeros(3)) + own
    cost, samples, signal = np.array(list(by_pose.values())).T
    excess = np.maximum(cost - samples, 0.0) / signal
    variance = _SIZES**2 + (np.sqrt(2.0 * samples) / signal)[:, None]
    poses = (np.log(variance) + excess[:, None] / variance).sum(axis=0)
    # Even steps of the logarithm: a size counts by its density times itself.
    exponents = -0.5 * (poses + (_SIZES / USUAL) ** 2) + np.log(_SIZES)
    most = exponents.max()
    return float(-2.0 * (most + np.log(np.exp(exponents - most).sum())))
