"""The remainder: what neither causes nor tolerances explain, and how much of it is allowed.

No model of a real robot is exact, so where a campaign states tolerances a little is always left: of
the size of half a per cent of the signal, different at every pose, and alike within one. Records
then say no more against a model than their poses do, however many samples they have (a discrepancy
in the manner of Kennedy and O'Hagan, doi:10.1111/1467-9868.00294, its variance integrated out over
the poses). Where everything is stated as exact nothing may be left.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from picchio.diagnosis.percussion.data.problem import Problem, signal_power
from picchio.diagnosis.percussion.fit.least_squares import Fit

# Of the signal, RMS: what is left of an honest model; above that something is wrong.
ALLOWED = 0.01
# Of the power of what the causes explain: what a named cause may leave, and a partial one.
_NAMED = 0.1
_PARTIAL = 0.5


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
    def of(cls, found: Fit) -> Remainder:
        """What a fit leaves.

        Args:
            found: the fit; its records' signals count.
        """
        signal = signal_power(found.records)
        return cls(max(found.chi_square - found.samples, 0.0), max(signal, 1e-300))

    @property
    def nrmse(self) -> float:
        """Relative to the signal, RMS."""
        return math.sqrt(self.excess / self.signal)

    @property
    def within_tolerance(self) -> bool:
        """Whether an honest model may leave as much."""
        return self.nrmse <= ALLOWED

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

    def may_be_partial(self, before: Remainder) -> bool:
        """Whether causes that leave this may be claimed in part.

        Args:
            before: what was left without them.
        """
        return self.share_of(before) <= _PARTIAL


def allowed(problem: Problem) -> bool:
    """Whether anything may be left: where everything is stated as exact, nothing may.

    Args:
        problem: whose tolerances are integrated out, if it has any.
    """
    return problem.marginal is not None


def decisive_gain(without: Fit, found: Fit) -> float:
    """By how much a fit beats another one, in units of chi-square, with a remainder in both.

    The remainder's variance is integrated out over the poses: what is left counts by the logarithm
    of its power.

    Args:
        without: the fit that lacks something.
        found: the fit that has it.
    """
    poses = len({record.pose for record in found.records})
    left = [max(each.cost - each.samples, 0.0) / poses for each in (without, found)]
    return poses * math.log((1.0 + left[0]) / (1.0 + left[1]))
