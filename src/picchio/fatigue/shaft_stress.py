"""Shear stress in a joint's shaft, from the torque or from the twist, and whether the two agree."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from picchio.core.arrays import FloatArray, as_floats
from picchio.robot.joint import Joint, Shaft


def stress_per_torque(joints: Iterable[Joint], without: float = math.nan) -> FloatArray:
    """What a unit torque brings in the part of every joint that wears: `Joint.per_torque`.

    Args:
        joints: n of them.
        without: the number for a joint without such a part.

    Returns:
        (n,) 1/m^3 of a shaft, r / Jp; 1/(N m) of a drive.
    """
    return np.array([joint.per_torque if joint.worn else without for joint in joints])


def shaft_stress_per_torque(joints: Iterable[Joint]) -> FloatArray:
    """As `stress_per_torque`, of shafts alone.

    Args:
        joints: n of them.

    Returns:
        (n,) 1/m^3; NaN for a joint without a shaft.
    """
    return np.array([joint.per_torque if joint.shaft else math.nan for joint in joints])


def shear_stress(torque: npt.ArrayLike, shaft: Shaft) -> FloatArray:
    """Shear stress at the shaft's surface under a torque: tau = T r / Jp.

    This holds whatever else yields in the joint, because shaft and spring carry the same torque.
    Saint-Venant torsion of a solid round bar.

    Args:
        torque: (...) N m; for a joint's spring, stiffness times deflection.
        shaft: the shaft.

    Returns:
        (...) Pa, with the torque's sign.

    Raises:
        InputError: a torque that is not finite.
    """
    return as_floats(torque, "torque") * (shaft.radius / shaft.polar_moment)


def shear_stress_from_deflection(deflection: npt.ArrayLike, shaft: Shaft) -> FloatArray:
    """Shear stress from the twist, the paper's eqs. 14-17: tau = G r x / l.

    Right only where the shaft is the joint's whole compliance (`check_shaft`).

    Args:
        deflection: (...) rad, link side less motor side.
        shaft: the shaft.

    Returns:
        (...) Pa, with the deflection's sign.

    Raises:
        InputError: a deflection that is not finite.
    """
    slope = shaft.shear_modulus * shaft.radius / shaft.length
    return as_floats(deflection, "deflection") * slope


def check_shaft(stiffness: float, shaft: Shaft) -> float:
    """How far the shaft's own torsional stiffness is from the joint's.

    Args:
        stiffness: the joint's stiffness k, N m/rad.
        shaft: the shaft.

    Returns:
        G Jp / (l k) - 1. Zero: the shaft is the whole spring, and both stresses agree. Positive:
        the shaft is stiffer, so something else yields too, and the stress from the deflection
        is too high by this fraction. Negative: the shaft alone would be softer than the joint,
        which no real joint is; one of the values is wrong.
    """
    return shaft.torsional_stiffness / stiffness - 1.0
