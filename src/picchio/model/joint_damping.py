"""A damping matrix from the joints' stated modal damping ratios."""

from __future__ import annotations

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.model.linear_system import undamped_modes


def shared_damping(
    mass: FloatArray,
    stiffness: FloatArray,
    deflections: FloatArray,
    joints: FloatArray,
    ratios: FloatArray,
    share: float,
) -> FloatArray:
    """C = M S diag(2 zeta omega) S^T M, ratios weighted by the joints' strain energy.

    Args:
        mass: (c, c) kg m^2.
        stiffness: (c, c) N m/rad, of all springs.
        deflections: (n, c), the joints' deflections by the coordinates.
        joints: (n,) N m/rad, the joints' springs.
        ratios: (n,) the joints' damping ratios.
        share: as `picchio.model.plant.Plant.modal_share`.

    Returns:
        (c, c) N m s/rad.
    """
    n = len(joints)
    whole = np.zeros_like(mass)
    if share > 0.0:
        whole = _by_modes(mass, stiffness, deflections, joints, ratios)
    if share == 1.0:
        return whole
    alone = _by_modes(mass[:n, :n], np.diag(joints), np.eye(n), joints, ratios)
    return np.asarray(share * whole + (1.0 - share) * deflections.T @ alone @ deflections)


def _by_modes(
    mass: FloatArray,
    stiffness: FloatArray,
    deflections: FloatArray,
    joints: FloatArray,
    ratios: FloatArray,
) -> FloatArray:
    omega, shapes = _modes(mass, stiffness)
    energy = joints[:, None] * (deflections @ shapes) ** 2 + 1e-300
    ratio = ratios @ energy / energy.sum(axis=0)
    weighted = mass @ shapes
    return np.asarray((weighted * (2.0 * ratio * omega)) @ weighted.T)


def _modes(mass: FloatArray, stiffness: FloatArray) -> tuple[FloatArray, FloatArray]:
    """As `undamped_modes`, by Cholesky's factor: small matrices, asked for many times."""
    try:
        inverse = np.linalg.inv(np.linalg.cholesky(mass))
    except np.linalg.LinAlgError:
        return undamped_modes(mass, stiffness)
    squared, vectors = np.linalg.eigh(inverse @ stiffness @ inverse.T)
    if not squared[0] > 0.0:
        return undamped_modes(mass, stiffness)
    return np.sqrt(squared), inverse.T @ vectors
