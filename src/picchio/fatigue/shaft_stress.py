"""Shear stress in a joint's shaft, from the torque or from the twist, and their agreement."""

from __future__ import annotations

import math
from typing import Protocol

import numpy.typing as npt

from picchio.core.arrays import FloatArray, as_floats
from picchio.core.errors import InputError


class ShaftLike(Protocol):
    """A solid round shaft: `picchio.robot.Shaft` is one."""

    @property
    def radius(self) -> float:
        """Outer radius, m."""

    @property
    def length(self) -> float:
        """Twisted length, m."""

    @property
    def shear_modulus(self) -> float:
        """Shear modulus G, Pa."""


def polar_moment(radius: float) -> float:
    """Polar second moment of area of a solid round section, pi r^4 / 2, in m^4.

    Args:
        radius: m.

    Raises:
        InputError: not a positive finite number.
    """
    return math.pi / 2.0 * _positive(radius, "shaft.radius") ** 4


def shear_stress(torque: npt.ArrayLike, shaft: ShaftLike) -> FloatArray:
    """Shear stress at the shaft's surface under a torque: tau = T r / Jp.

    This holds whatever else yields in the joint, because shaft and spring carry the same torque.
    Saint-Venant torsion of a solid round bar.

    Args:
        torque: (...) N m; for a joint's spring, stiffness times deflection.
        shaft: the shaft.

    Returns:
        (...) Pa, with the torque's sign.

    Raises:
        InputError: a torque that is not finite, or a shaft that has no positive size.
    """
    return as_floats(torque, "torque") * (shaft.radius / polar_moment(shaft.radius))


def shear_stress_from_deflection(deflection: npt.ArrayLike, shaft: ShaftLike) -> FloatArray:
    """Shear stress from the twist, the paper's eq. 14-17: tau = G r x / l.

    Right only where the whole of the joint's compliance is the shaft's (`check_shaft`).

    Args:
        deflection: (...) rad, link side less motor side.
        shaft: the shaft.

    Returns:
        (...) Pa, with the deflection's sign.

    Raises:
        InputError: a deflection that is not finite, or a shaft that has no positive size.
    """
    modulus = _positive(shaft.shear_modulus, "shaft.shear_modulus")
    slope = modulus * _positive(shaft.radius, "shaft.radius")
    return as_floats(deflection, "deflection") * (slope / _positive(shaft.length, "shaft.length"))


def check_shaft(stiffness: float, shaft: ShaftLike) -> float:
    """How far the shaft's own torsional stiffness is from the joint's.

    Args:
        stiffness: the joint's stiffness k, N m/rad.
        shaft: the shaft.

    Returns:
        G Jp / (l k) - 1. Zero: the shaft is the whole spring, and both stresses agree. Positive:
        the shaft is stiffer, so something else yields too, and the stress from the deflection
        is too high by this fraction. Negative: the shaft alone would be softer than the joint,
        which no real joint is; one of the values is wrong.

    Raises:
        InputError: a value that is not positive and finite.
    """
    modulus = _positive(shaft.shear_modulus, "shaft.shear_modulus")
    own = modulus * polar_moment(shaft.radius) / _positive(shaft.length, "shaft.length")
    return own / _positive(stiffness, "stiffness") - 1.0


def _positive(value: float, key: str) -> float:
    number = float(as_floats(value, key))
    if number <= 0.0:
        raise InputError("must be positive", key=key, value=value)
    return number
