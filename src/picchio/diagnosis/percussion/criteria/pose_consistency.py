"""Pose consistency: whether the fitted unknowns are the same at every pose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.diagnosis.percussion.criteria.whiteness import Evidence, whiteness_test
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.fit.least_squares import Fit

# Poses needed to compare poses; of fewer the records are compared.
_POSES = 3
# Directions of a pose's unknowns that its data tell this much less than its best are not told.
_TOLD = 1e-9
# Of what all poses tell of a direction: where the others tell less, one pose tells it alone.
_ALONE = 1e-3


def pose_inconsistency(found: Fit) -> float:
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

    fall, degrees = 0.0, 0
    parts = _by_pose(found)
    if not parts:
        return 0.0
    normal, gradient = np.zeros_like(parts[0][0]), np.zeros_like(parts[0][1])
    for own, right in parts:
        some, rank = _fall(own, right)
        fall, degrees = fall + some, degrees + rank
        normal, gradient = normal + own, gradient + right
    together, rank = _fall(normal, gradient)
    degrees -= rank
    if degrees < 1:
        return 0.0
    return float(np.clip(norm.isf(chi2.sf(fall - together, degrees)), -38.0, 38.0))


def fit_evidence(problem: Problem, whole: Fit) -> Evidence:
    """What a fit to all records leaves, and whether its unknowns hold at every pose."""
    return replace(whiteness_test(problem, whole), pose_inconsistency=pose_inconsistency(whole))


def jackknife_covariance(found: Fit) -> FloatArray:
    """(unknowns, unknowns) covariance by how the fit moves where one pose is left out.

    To first order (the jackknife: Quenouille, doi:10.1093/biomet/43.3-4.353). Where more than noise
    is left, the poses disagree by more than the fit's own covariance says.

    Args:
        found: a fit with its Jacobian, of all records.
    """
    parts = _by_pose(found)
    size = len(found.hypothesis.unknowns())
    if len(parts) < 2 or size == 0:
        return np.zeros((size, size))
    whole = found.normal_matrix()
    scale = np.sqrt(np.maximum(whole.diagonal(), 1e-300))
    values, vectors = np.linalg.eigh(whole / np.outer(scale, scale))
    told = values > _TOLD * max(float(values.max()), 1e-300)
    # In these coordinates all poses together tell every direction as well as any other.
    basis = vectors[:, told] / np.sqrt(values[told]) / scale[:, None]
    moved = []
    for own, right in parts:
        # What this pose all but alone tells stays: the others have nothing to say of it.
        shares, ways = np.linalg.eigh(basis.T @ (whole - own) @ basis)
        kept = basis @ ways[:, shares > _ALONE]
        # The fit stands where all gradients cancel: without one pose that one's pulls it back.
        moved.append(kept @ ((kept.T @ right) / shares[shares > _ALONE]))
    spread = np.array(moved) - np.mean(moved, axis=0)
    count = len(parts)
    return np.asarray((count - 1) / count * spread.T @ spread)


def _by_pose(found: Fit) -> list[tuple[FloatArray, FloatArray]]:
    """Normal matrix and gradient of every pose; of every record, where poses are few."""
    if not found.jacobians:
        return []
    poses = [r.pose for r in found.records]
    units = poses if len(set(poses)) >= _POSES else list(range(len(poses)))
    parts: dict[int, tuple[FloatArray, FloatArray]] = {}
    for unit, jacobian, residual in zip(units, found.jacobians, found.residuals, strict=True):
        own, right = jacobian.T @ jacobian, jacobian.T @ residual.ravel()
        if unit in parts:
            own, right = own + parts[unit][0], right + parts[unit][1]
        parts[unit] = own, right
    return [parts[unit] for unit in sorted(parts)]


def _fall(normal: FloatArray, gradient: FloatArray) -> tuple[float, int]:
    """By how much chi-square falls in a Gauss-Newton step, and in how many directions."""
    scale = np.sqrt(np.maximum(normal.diagonal(), 1e-300))
    values, vectors = np.linalg.eigh(normal / np.outer(scale, scale))
    told = values > _TOLD * max(float(values.max(initial=0.0)), 1e-300)
    along = vectors.T @ (gradient / scale)
    return float((along[told] ** 2 / values[told]).sum()), int(told.sum())
