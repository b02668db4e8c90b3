"""Are the unknowns the same at every pose? What a pose's own values would imitate shows here."""

from __future__ import annotations

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.diagnosis.percussion.fit import Fit

# Poses needed to compare poses; of fewer the records are compared.
_POSES = 3
# Directions of a pose's unknowns that its data tell this much less than its best are not told.
_TOLD = 1e-9


def unsteadiness(found: Fit) -> float:
    """By how many standard deviations the unknowns differ from pose to pose, all together.

    What is wrong may look like another stiffness in each pose, and leave noise there; then the
    stiffnesses disagree. By how much chi-square would fall if each pose had its own values, to
    first order: chi-square distributed, where the model is right, with as many degrees of freedom
    as there are values too many (a Chow test, doi:10.2307/1910133).

    Args:
        found: a fit with its Jacobian, of all records.

    Returns:
        of a normal variable as likely.
    """
    from scipy.stats import chi2, norm

    if found.jacobians is None:
        return 0.0
    poses = [r.pose for r in found.records]
    units = poses if len(set(poses)) >= _POSES else list(range(len(poses)))
    fall, degrees = 0.0, 0
    size = found.jacobians[0].shape[1] if found.jacobians else 0
    normal, gradient = np.zeros((size, size)), np.zeros(size)
    for unit in sorted(set(units)):
        own = np.zeros((size, size))
        right = np.zeros(size)
        for k, jacobian, residual in zip(units, found.jacobians, found.residuals, strict=True):
            if k == unit:
                own += jacobian.T @ jacobian
                right += jacobian.T @ residual.ravel()
        some, rank = _fall(own, right)
        fall, degrees = fall + some, degrees + rank
        normal, gradient = normal + own, gradient + right
    together, rank = _fall(normal, gradient)
    degrees -= rank
    if degrees < 1:
        return 0.0
    return float(np.clip(norm.isf(chi2.sf(fall - together, degrees)), -38.0, 38.0))


def _fall(normal: FloatArray, gradient: FloatArray) -> tuple[float, int]:
    """By how much chi-square falls in a Gauss-Newton step, and in how many directions."""
    scale = np.sqrt(np.maximum(normal.diagonal(), 1e-300))
    values, vectors = np.linalg.eigh(normal / np.outer(scale, scale))
    told = values > _TOLD * max(float(values.max(initial=0.0)), 1e-300)
    along = vectors.T @ (gradient / scale)
    return float((along[told] ** 2 / values[told]).sum()), int(told.sum())
