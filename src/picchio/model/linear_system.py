"""Linear equations of motion about a pose: M x'' + C x' + K x = B F(t) n."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError


@dataclass(frozen=True, eq=False)
class LinearSystem:
    """Small vibration about the loaded equilibrium, paper eq. 5 with damping.

    Attributes:
        mass_matrix: (n, n) kg m^2 (kg for a prismatic coordinate), symmetric positive definite.
        damping_matrix: (n, n) N m s/rad, symmetric.
        stiffness_matrix: (n, n) N m/rad, symmetric positive definite.
        input_matrix: (n, 3) m, generalised force per newton at the tool along x, y, z (world):
            the transposed tool Jacobian.
        output_matrix: (m, n), from coordinates to joint deflections.
        output_names: m names, the joints.
    """

    mass_matrix: FloatArray
    damping_matrix: FloatArray
    stiffness_matrix: FloatArray
    input_matrix: FloatArray
    output_matrix: FloatArray
    output_names: tuple[str, ...]

    def __post_init__(self) -> None:
        n = self.mass_matrix.shape[0]
        expected = {
            "mass_matrix": (n, n),
            "damping_matrix": (n, n),
            "stiffness_matrix": (n, n),
            "input_matrix": (n, 3),
            "output_matrix": (len(self.output_names), n),
        }
        for name, shape in expected.items():
            value = np.array(getattr(self, name), dtype=float)
            if value.shape != shape:
                raise InputError(f"{name} has shape {value.shape}, expected {shape}")
            if not np.isfinite(value).all():
                raise InputError(f"{name} holds a value that is not finite")
            value.flags.writeable = False
            object.__setattr__(self, name, value)


def undamped_modes(
    mass_matrix: FloatArray, stiffness_matrix: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Solve K S = M S D (paper eq. 8) with S^T M S = I.

    Args:
        mass_matrix: (n, n).
        stiffness_matrix: (n, n).

    Returns:
        omega: (n,) rad/s, ascending; S: (n, n), a mode a column.

    Raises:
        InputError: M or K is not positive definite.
    """
    from scipy.linalg import LinAlgError, eigh

    try:
        squared, shapes = eigh(stiffness_matrix, mass_matrix)
    except LinAlgError:
        raise InputError("the mass matrix is not positive definite at this pose") from None
    if squared[0] <= 0.0:
        raise InputError(
            "the stiffness matrix is not positive definite at this pose: "
            "gravity overturns the springs",
            value=float(squared[0]),
        )
    return np.sqrt(squared), shapes


def modal_damping_matrix(
    mass_matrix: FloatArray,
    stiffness: FloatArray,
    damping_ratio: ArrayLike,
) -> FloatArray:
    """C = M S diag(2 zeta omega) S^T M, with the undamped modes of M and the springs alone.

    Where the joints' ratios differ, a mode's ratio is their mean, weighted by the share of the
    mode's strain energy that each joint's spring holds (Johnson and Kienholz, AIAA Journal 20
    (1982) 1284, doi:10.2514/3.51190).

    Args:
        mass_matrix: (n, n).
        stiffness: (n,) N m/rad, the springs.
        damping_ratio: scalar or (n,), one for each joint.

    Returns:
        (n, n) N m s/rad.
    """
    ratios = np.broadcast_to(np.asarray(damping_ratio, dtype=float), stiffness.shape)
    return _by_modes(mass_matrix, np.diag(stiffness), np.eye(len(stiffness)), stiffness, ratios)


def shared_damping(
    mass: FloatArray,
    stiffness: FloatArray,
    deflections: FloatArray,
    joints: FloatArray,
    ratios: FloatArray,
    share: float,
    scales: Sequence[float] = (),
) -> FloatArray:
    """As `modal_damping_matrix`, in coordinates of which joints' deflections are a part.

    Args:
        mass: (c, c) kg m^2.
        stiffness: (c, c) N m/rad, of all springs.
        deflections: (n, c), the joints' deflections by the coordinates.
        joints: (n,) N m/rad, the joints' springs.
        ratios: (n,) the joints' damping ratios.
        share: as `picchio.model.plant.Plant.modal_share`.
        scales: factors on the modes' ratios, by ascending frequency; 1 beyond them.

    Returns:
        (c, c) N m s/rad.
    """
    n = len(joints)
    whole = np.zeros_like(mass)
    if share > 0.0:
        whole = _by_modes(mass, stiffness, deflections, joints, ratios, scales)
    if share == 1.0:
        return whole
    alone = _by_modes(mass[:n, :n], np.diag(joints), np.eye(n), joints, ratios, scales)
    return np.asarray(share * whole + (1.0 - share) * deflections.T @ alone @ deflections)


def _by_modes(
    mass: FloatArray,
    stiffness: FloatArray,
    deflections: FloatArray,
    joints: FloatArray,
    ratios: FloatArray,
    scales: Sequence[float] = (),
) -> FloatArray:
    omega, shapes = _modes(mass, stiffness)
    energy = joints[:, None] * (deflections @ shapes) ** 2 + 1e-300
    ratio = ratios @ energy / energy.sum(axis=0)
    if len(scales):
        known = min(len(scales), ratio.size)
        ratio[:known] = ratio[:known] * np.asarray(scales)[:known]
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
