"""Likelihood of S-N tests: Basquin's line with an endurance limit, and two causes of scatter.

Specimens differ in strength by a factor e^u, u ~ Normal(0, s^2), which moves line and limit alike;
and each life scatters by itself, by e^w, w ~ Normal(0, (k v)^2). A specimen breaks where the stress
exceeds its own limit: ln S > ln SD + u; then ln N = ln ND - k (ln S - ln SD - u) + w. So failures
and run-outs at any life have a probability, weak specimens explain early failures near the limit,
and the likelihood is smooth in every parameter. (A random fatigue limit, as Pascual and Meeker's,
Technometrics 41 (1999) 277-290, with Basquin's line in place of Stromeyer's.)

With d = ln S - ln SD, z = (ln N - ln ND) / k + d, t^2 = s^2 + v^2 and rho = s / t:
failure: phi(z / t) / (k t) Phi((d - rho^2 z) / (rho sqrt(1 - rho^2) t));
run-out: Phi(-d / s) + Phi2(d / s, -z / t; -rho).

A few tests about the limit say next to nothing of how the scatter divides (separated levels would
have s = 0, and make everything look certain), so logit rho^2 has a standard normal penalty: the
share of strength is about one half, 0.12 to 0.88, unless the tests know better.

Parameters: theta = (ln SD_P, ln ND, ln k, ln t, logit rho^2), where SD_P = SD e^(-z_P t).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from picchio.core.arrays import FloatArray

_FARTHEST = 12.0
"""Where an interval is called unbounded: a factor e^12 (1.6e5) from the estimate."""

_LINE = 2
"""Degrees of freedom that the line through the failures takes, as in a linear regression. The limit
takes next to none: it follows from which specimens break, not from how their lives scatter."""

_NEVER = -1e12
"""A log-likelihood that no data have; finite, so that searches can compute with it."""


@dataclass(frozen=True)
class Likelihood:
    """The (penalised) log-likelihood of a set of tests, with its derivatives.

    Attributes:
        stress: (n,) ln of the stress amplitude.
        cycles: (n,) ln of the cycles at failure, or reached without.
        failed: (n,) whether it failed.
        z: standard normal quantile z_P of the survival that the first parameter is for.
        limited: whether there is an endurance limit. Without one, the line goes on and
            SD is the strength at ND, which is anyone's choice.
    """

    stress: FloatArray
    cycles: FloatArray
    failed: np.ndarray
    z: float = 0.0
    limited: bool = True

    def __call__(self, theta: FloatArray) -> tuple[float, FloatArray]:
        """Value and gradient (5,) at theta."""
        from picchio.fatigue.sn.kernel import objective

        gradient = np.zeros(5)
        value = objective(
            theta, self.stress, self.cycles, self.failed, float(self.z), self.limited, gradient
        )
        return float(value), gradient

    def hessian(self, theta: FloatArray) -> FloatArray:
        """(5, 5) second derivatives, by central differences of the gradient."""
        step = 1e-5
        rows = np.empty((5, 5))
        for i in range(5):
            shift = np.zeros(5)
            shift[i] = step
            rows[i] = (self(theta + shift)[1] - self(theta - shift)[1]) / (2.0 * step)
        return 0.5 * (rows + rows.T)


def maximise(
    likelihood: Likelihood, start: FloatArray, free: list[int], steps: int = 100
) -> tuple[float, FloatArray]:
    """Levenberg-damped Newton ascent over the `free` parameters.

    Returns:
        value and theta where it ended.
    """
    from picchio.fatigue.sn.kernel import ascend

    lk = likelihood
    value, theta = ascend(
        start, np.array(free), lk.stress, lk.cycles, lk.failed, float(lk.z), lk.limited, steps
    )
    return float(value), theta


class Profile:
    """The likelihood about its maximum, one parameter at a time, corrected for small samples.

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
        at_median = replace(likelihood, z=0.0)
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
        found = minimize_scalar(
            lambda lam: -self._adjusted(3, lam, self.theta)[0],
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
        """Where the profile has dropped: outward until it has, then by false position.

        The square root of the drop is nearly linear in the parameter, so this takes few steps.
        """

        def end(side: float) -> float:
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
                    return float(side * np.inf)
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
            return float(centre + side * reach)

        return end(-1.0), end(1.0)

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
