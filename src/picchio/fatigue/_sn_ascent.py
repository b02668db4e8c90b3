"""The compiled search for the maximum of the S-N likelihood. Importing this module loads numba."""

from __future__ import annotations

import math

import numba
import numpy as np

from picchio.fatigue._sn_kernel import log_likelihood
from picchio.fatigue._types import FloatArray

_STEP = 1e-5


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
    """The penalised log-likelihood; its gradient (5,) is written in place."""
    gradient[:] = 0.0
    value = log_likelihood(theta, stress, cycles, failed, z_p, limited, gradient)
    gradient[4] -= theta[4]
    return value - 0.5 * theta[4] ** 2


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
