"""Every set of causes that was fitted, with its evidence: nothing that was seen is lost."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from picchio.diagnosis.evidence.estimate import Fit

Labels = frozenset[str]


@dataclass(eq=False)
class Table:
    """Fits by the labels of their causes.

    Attributes:
        candidates: how many causes there may be: the prior odds of one are 1 to as many.
        fits: the best of each set.
    """

    candidates: int
    fits: dict[Labels, Fit] = field(default_factory=dict)

    def score(self, fit: Fit) -> float:
        """Log of evidence times prior odds, nats.

        Args:
            fit: of a set of causes.

        Returns:
            nats.
        """
        return fit.evidence - math.log(max(self.candidates, 1)) * len(labels_of(fit)) - fit.penalty

    def keep(self, fit: Fit) -> Fit:
        """The fit, which is put into the table where it is the best of its set.

        Args:
            fit: of a set of causes.
        """
        key = labels_of(fit)
        if key not in self.fits or self.score(fit) > self.score(self.fits[key]):
            self.fits[key] = fit
        return fit

    @property
    def best(self) -> Fit:
        """The fit of the highest score."""
        return max(self.fits.values(), key=self.score)

    def weights(self) -> dict[Labels, float]:
        """Posterior probability of each set among all that were fitted.

        Returns:
            by the labels of the set.
        """
        scores = {key: self.score(fit) for key, fit in self.fits.items()}
        total = float(np.logaddexp.reduce(list(scores.values())))
        return {key: math.exp(score - total) for key, score in scores.items()}

    def rivals(self, within: float) -> Iterator[tuple[Labels, Fit]]:
        """Sets that are nearly as probable as the best, and are not the best with more.

        Args:
            within: nats.

        Returns:
            labels and fit of each.
        """
        best = self.best
        own, score = labels_of(best), self.score(best)
        for key, fit in self.fits.items():
            if not key >= own and self.score(fit) > score - within:
                yield key, fit

    def odds(self) -> float:
        """Log odds of any cause at all against none, nats.

        Returns:
            minus infinity where no set has a cause.
        """
        some = [self.score(fit) for key, fit in self.fits.items() if key]
        if not some:
            return -math.inf
        return float(np.logaddexp.reduce(some)) - self.score(self.fits[frozenset()])


def labels_of(fit: Fit) -> Labels:
    """Labels of a fit's causes.

    Args:
        fit: of a set of causes.

    Returns:
        a set of effect:target.
    """
    return frozenset(cause.label for cause in fit.likelihood.causes)
