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

from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import FloatArray


@dataclass(frozen=True)
class Likelihood:
    """The (penalised) log-likelihood of a set of tests, with its derivatives.

    Attributes:
        stress: (n,) ln of the stress amplitude.
        cycles: (n,) ln of the cycles at failure, or reached without.
        failed: (n,) whether it failed.
        z: standard normal quantile z_P of the survival that the first parameter is for.
        limited: whether there is an endurance limit. Without one, the line has no end and
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
