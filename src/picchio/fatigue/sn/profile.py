"""Confidence intervals from the profile likelihood of S-N tests, corrected for small samples."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.fatigue.sn.likelihood import Likelihood, maximise

_FARTHEST = 12.0
"""Where an interval is called unbounded: a factor e^12 (1.6e5) from the estimate."""

_LINE = 2
"""Degrees of freedom that the line through the failures takes, as in a linear regression. The limit
takes next to none: it follows from which specimens break, not from how their lives scatter."""

_NEVER = -1e12
"""A log-likelihood that no data have; finite, so that searches can compute with it."""


class Profile:
    """The likelihood about its maximum, one parameter at a time.

    Attributes:
        theta: (5,) the maximum.
        value: the log-likelihood there.
        threshold: by how much the log-likelihood may drop within an interval.
    """

    def __init__(
        self, likelihood: Likelihood, theta: FloatArray, free: list[int], level: float
    ) -> None:
        """Find the maximum from a guess `theta` (5,), and the threshold for `level`."""
        from scipy.stats import chi2
        from scipy.stats import t as student

        self.likelihood, self.free = likelihood, free
        self._places = [i for i in free if i in (0, 1, 2)]
        self.value, self.theta = maximise(likelihood, theta, free)
        information = -likelihood.hessian(self.theta)
        # Uncensored normal tests give 2 n: so many failures is what the tests are worth.
        at_median = dataclasses.replace(likelihood, z=0.0)
        median = self.theta.copy()
        median[0] += likelihood.z * np.exp(median[3])
        effective = max(-float(at_median.hessian(median)[3, 3]) / 2.0, 1.0)
        freedom = max(effective - _LINE, 1.0)
        quantile = float(student.ppf(0.5 + level / 2.0, freedom))
        self.threshold = effective / 2.0 * float(np.log1p(quantile**2 / freedom))
        self._plain = float(chi2.ppf(level, 1)) / 2.0
        self._spread = np.linalg.pinv(information[np.ix_(free, free)])
        steps = np.sqrt(np.clip(np.diag(self._spread), 1e-8, 1.0))
        self._step = dict(zip(free, steps, strict=True))

    def interval(self, index: int) -> tuple[float, float]:
        """Ends of the interval of one parameter (a logarithm); infinite where unbounded."""
        return self._ends(index, self.theta[index], self.value, self.threshold, self._at)

    def covariance(self) -> tuple[tuple[float, ...], ...]:
        """(3, 3) of the first three parameters, as wide as the threshold makes intervals."""
        full = np.zeros((5, 5))
        full[np.ix_(self.free, self.free)] = self._spread
        values, vectors = np.linalg.eigh(full[:3, :3] * self.threshold / self._plain)
        whole = (vectors * np.maximum(values, 0.0)) @ vectors.T
        return tuple(tuple(float(v) for v in row) for row in whole)

    def scatter(self) -> tuple[float, float, float]:
        """Ln t by the adjusted profile: its maximum, and the ends of its interval."""
        from scipy.optimize import minimize_scalar

        centre, step = float(self.theta[3]), self._step[3]
        start = self.theta

        def loss(lam: float) -> float:
            return -self._adjusted(3, lam, start)[0]

        found = minimize_scalar(
            loss,
            bounds=(centre - step, centre + 6.0 * step),
            method="bounded",
            options={"xatol": 1e-5},
        )
        best, top = float(found.x), -float(found.fun)
        low, high = self._ends(3, best, top, self._plain, self._adjusted)
        return best, low, high

    def _ends(
        self,
        index: int,
        centre: float,
        top: float,
        drop: float,
        profile: Callable[[int, float, FloatArray], tuple[float, FloatArray]],
    ) -> tuple[float, float]:
        low = self._end(index, centre, top, drop, -1.0, profile)
        return low, self._end(index, centre, top, drop, 1.0, profile)

    def _end(
        self,
        index: int,
        centre: float,
        top: float,
        drop: float,
        side: float,
        profile: Callable[[int, float, FloatArray], tuple[float, FloatArray]],
    ) -> float:
        """Where the profile has dropped: outward until it has, then by false position.

        The square root of the drop is nearly linear in the parameter, so this takes few steps.
        """
        near, at_near = 0.0, -np.sqrt(drop)
        reach, start = self._step[index], self.theta
        while True:
            value, start = profile(index, centre + side * reach, start)
            at = np.sqrt(max(top - value, 0.0)) - np.sqrt(drop)
            if at >= 0.0:
                break
            near, at_near = reach, at
            reach *= 1.6
            if reach > _FARTHEST:
                return side * np.inf
        far, at_far = reach, at
        for _ in range(40):
            reach = near - at_near * (far - near) / (at_far - at_near)
            reach = min(max(reach, near + 0.02 * (far - near)), far - 0.02 * (far - near))
            value, start = profile(index, centre + side * reach, start)
            at = np.sqrt(max(top - value, 0.0)) - np.sqrt(drop)
            if abs(at) < 1e-4 or far - near < 1e-7:
                break
            if at > 0.0:
                far, at_far = reach, at
            else:
                near, at_near = reach, at
        return centre + side * reach

    def _at(self, index: int, value: float, start: FloatArray) -> tuple[float, FloatArray]:
        point = start.copy()
        point[index] = value
        return maximise(self.likelihood, point, [i for i in self.free if i != index])

    def _adjusted(self, index: int, value: float, start: FloatArray) -> tuple[float, FloatArray]:
        """Cox and Reid: the profile, less half the log-determinant of the line's information."""
        best, theta = self._at(index, value, start)
        information = -self.likelihood.hessian(theta)[np.ix_(self._places, self._places)]
        sign, logdet = np.linalg.slogdet(information)
        good = sign > 0 and np.isfinite(logdet)
        return (best - 0.5 * float(logdet) if good else _NEVER), theta
