"""The likelihood of S-N tests and the search for its maximum, compiled. Imports numba."""

from __future__ import annotations

import math

import numba
import numpy as np

from picchio.core.arrays import FloatArray

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(20)
_FEW_NODES, _FEW_WEIGHTS = np.polynomial.legendre.leggauss(12)
_STEP = 1e-5
_HALF_LOG_2PI = 0.5 * math.log(2.0 * math.pi)


@numba.njit(cache=True)
def normal_cdf(x: float) -> float:
    """Phi(x)."""
    return 0.5 * math.erfc(-x / math.sqrt(2.0))


@numba.njit(cache=True)
def log_normal_cdf(x: float) -> float:
    """Logarithm of Phi(x), far into the lower tail."""
    if x > -30.0:
        return math.log(normal_cdf(x))
    square = 1.0 / (x * x)
    tail = 1.0 - square * (1.0 - 3.0 * square)
    return -0.5 * x * x - _HALF_LOG_2PI - math.log(-x) + math.log(tail)


@numba.njit(cache=True)
def bivariate_upper(h: float, k: float, r: float) -> float:
    """P(X > h, Y > k) of standard normals with correlation r.

    Drezner and Wesolowsky (1990) as improved by Genz, Statistics and Computing 14 (2004) 251-260.
    """
    hk, total = h * k, 0.0
    if abs(r) < 0.925:
        half, arc = 0.5 * (h * h + k * k), 0.5 * math.asin(r)
        nodes, weights = (_FEW_NODES, _FEW_WEIGHTS) if abs(r) < 0.75 else (_NODES, _WEIGHTS)
        for i in range(nodes.shape[0]):
            sn = math.sin(arc * (1.0 + nodes[i]))
            total += weights[i] * math.exp((sn * hk - half) / (1.0 - sn * sn))
        return total * arc / (2.0 * math.pi) + normal_cdf(-h) * normal_cdf(-k)
    if r < 0.0:
        k, hk = -k, -hk
    if abs(r) < 1.0:
        rest = 1.0 - r * r
        a, gap = math.sqrt(rest), (h - k) ** 2
        c, d = (4.0 - hk) / 8.0, (12.0 - hk) / 80.0
        power = -0.5 * (gap / rest + hk)
        if power > -100.0:
            bend = 1.0 - c * (gap - rest) * (1.0 - d * gap) / 3.0 + c * d * rest * rest
            total = a * math.exp(power) * bend
        if hk > -100.0:
            b = math.sqrt(gap)
            tail = math.sqrt(2.0 * math.pi) * normal_cdf(-b / a)
            total -= math.exp(-0.5 * hk) * tail * b * (1.0 - c * gap * (1.0 - d * gap) / 3.0)
        a *= 0.5
        integral = 0.0
        for i in range(_NODES.shape[0]):
            square = (a * (1.0 + _NODES[i])) ** 2
            power = -0.5 * (gap / square + hk)
            if power > -100.0:
                root = math.sqrt(1.0 - square)
                series = 1.0 + c * square * (1.0 + 5.0 * d * square)
                exact = math.exp(-0.5 * hk * square / (1.0 + root) ** 2) / root
                integral += _WEIGHTS[i] * math.exp(power) * (series - exact)
        total = (a * integral - total) / (2.0 * math.pi)
    if r > 0.0:
        return total + normal_cdf(-max(h, k))
    if h >= k:
        return -total
    between = normal_cdf(k) - normal_cdf(h) if h < 0.0 else normal_cdf(-h) - normal_cdf(-k)
    return between - total


@numba.njit(cache=True)
def objective(
    theta: FloatArray,
    stress: FloatArray,
    cycles: FloatArray,
    failed: np.ndarray,
    z_p: float,
    limited: bool,
    gradient: FloatArray,
) -> float:
    """See `picchio.fatigue.sn.likelihood`; the gradient (5,) is written in place.

    `limited`: whether there is an endurance limit; else the line goes on.
    """
    t, k = math.exp(theta[3]), math.exp(theta[2])
    share = 1.0 / (1.0 + math.exp(-theta[4]))
    rho, rest = math.sqrt(share), math.sqrt(1.0 - share)
    limit = theta[0] + z_p * t
    g = rho * rest
    rho_by_eta = 0.5 * rho * (1.0 - share)
    gradient[:] = 0.0
    total = 0.0
    for i in range(stress.shape[0]):
        x = (stress[i] - limit) / t
        gap = (cycles[i] - theta[1]) / (k * t)
        w = gap + x
        # What the term's derivatives by x, w and rho are; then the chain rule.
        if not limited:
            by_x, by_rho = 0.0, 0.0
            if failed[i]:
                total += -0.5 * w * w - _HALF_LOG_2PI - theta[3] - theta[2]
                by_w = -w
                gradient[2] -= 1.0
                gradient[3] -= 1.0
            else:
                alive_log = log_normal_cdf(-w)
                total += alive_log
                by_w = -math.exp(-0.5 * w * w - _HALF_LOG_2PI - alive_log)
        elif failed[i]:
            q = (x - w * share) / g
            below = log_normal_cdf(q)
            total += -0.5 * w * w - _HALF_LOG_2PI - theta[3] - theta[2] + below
            mills = math.exp(-0.5 * q * q - _HALF_LOG_2PI - below)
            by_x = mills / g
            by_w = -w - mills * rho / rest
            by_rho = mills * (-2.0 * w * rho / g - q * (1.0 - 2.0 * share) / (rest * g))
            gradient[2] -= 1.0
            gradient[3] -= 1.0
        else:
            h = x / rho
            # P(U > d) + P(U < d, Z > z), the second as P(-U > -d, Z > z), correlation -rho.
            alive = normal_cdf(-h) + bivariate_upper(-h, w, -rho)
            alive = max(alive, 1e-290)
            total += math.log(alive)
            scale = -1.0 / (alive * math.sqrt(2.0 * math.pi))
            by_h = scale * math.exp(-0.5 * h * h) * normal_cdf((w - rho * h) / rest)
            by_w = scale * math.exp(-0.5 * w * w) * normal_cdf((h - rho * w) / rest)
            both = (h * h - 2.0 * rho * h * w + w * w) / (2.0 * (1.0 - share))
            by_x = by_h / rho
            by_rho = scale * math.exp(-both) / (rest * math.sqrt(2.0 * math.pi))
            by_rho -= by_h * h / rho
        gradient[0] -= (by_x + by_w) / t
        gradient[1] -= by_w / (k * t)
        gradient[2] -= by_w * gap
        gradient[3] -= by_x * (x + z_p) + by_w * (w + z_p)
        gradient[4] += by_rho * rho_by_eta
    # The penalty: logit rho^2 is standard normal unless the tests know better.
    gradient[4] -= theta[4]
    return total - 0.5 * theta[4] ** 2


@numba.njit(cache=True)
def ascend(
    start: FloatArray,
    free: np.ndarray,
    stress: FloatArray,
    cycles: FloatArray,
    failed: np.ndarray,
    z_p: float,
    limited: bool,
    steps: int,
) -> tuple[float, FloatArray]:
    """Levenberg-damped Newton ascent over the parameters whose indices are `free`."""
    m = free.shape[0]
    theta, trial = start.copy(), start.copy()
    gradient, shifted = np.zeros(5), np.zeros(5)
    value = objective(theta, stress, cycles, failed, z_p, limited, gradient)
    damping = 1e-3
    curvature, scale, slope = np.empty((m, m)), np.empty(m), np.empty(m)
    for _ in range(steps):
        for i in range(m):
            trial[:] = theta
            trial[free[i]] += _STEP
            objective(trial, stress, cycles, failed, z_p, limited, shifted)
            for j in range(m):
                curvature[i, j] = (gradient[free[j]] - shifted[free[j]]) / _STEP
        for i in range(m):
            scale[i] = math.sqrt(max(abs(curvature[i, i]), 1e-6))
            slope[i] = gradient[free[i]] / scale[i]
        symmetric = 0.5 * (curvature + curvature.T) / np.outer(scale, scale)
        if not np.isfinite(symmetric).all():
            break
        values, vectors = np.linalg.eigh(symmetric)
        along = vectors.T @ slope
        moved, gain, reach = False, 0.0, 0.0
        for _ in range(30):
            # Absolute eigenvalues keep the step uphill where the surface is not concave.
            step = (vectors @ (along / (np.maximum(np.abs(values), 1e-8) + damping))) / scale
            step *= min(1.0, 0.7 / (np.abs(step).max() + 1e-300))
            trial[:] = theta
            for i in range(m):
                trial[free[i]] += step[i]
            new = objective(trial, stress, cycles, failed, z_p, limited, shifted)
            if np.isfinite(new) and new >= value:
                damping, moved = max(damping / 8.0, 1e-10), True
                gain, reach = new - value, np.abs(step).max()
                break
            damping = max(4.0 * damping, 1e-6)
        if not moved:
            break
        theta[:] = trial
        gradient[:] = shifted
        value = new
        if gain < 1e-9 and reach < 1e-4:
            break
    return value, theta
