"""A flexible joint and its drive: shaft, stiffness curve, gravity balancer."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from picchio.core.arrays import Vector
from picchio.core.errors import InputError


@dataclass(frozen=True)
class StiffnessCurve:
    """Stiffness that grows with the torque, as catalogues of strain-wave gears give it.

    Wind-up against torque is three straight lines (for example Harmonic Drive, *Engineering data
    HFUC*, "torsional stiffness"). Small vibration about the pose's gravity torque sees the slope
    there, so the model takes the tangent.

    Args:
        k1: N m/rad (N/m for a prismatic joint) below `t1`.
        k2: between `t1` and `t2`.
        k3: above `t2`.
        t1: N m (N), the first corner.
        t2: the second corner, above `t1`.
    """

    k1: float
    k2: float
    k3: float
    t1: float
    t2: float

    def tangent(self, torque: ArrayLike) -> NDArray[np.float64]:
        """The slope at a torque, N m/rad; at a corner that of the line below it.

        Args:
            torque: N m, any shape.
        """
        size = np.abs(np.asarray(torque, dtype=float))
        return np.where(size <= self.t1, self.k1, np.where(size <= self.t2, self.k2, self.k3))


@dataclass(frozen=True)
class Balancer:
    """A gravity balancer: a spring or cylinder beside a joint that carries part of the weight.

    It pulls two points together, one fixed to the joint's parent link and one to its child link.
    With the distance d(q) between them its energy is E(q) = k (d - d0)^2 / 2 + F d, so the drive
    carries dE/dq on top of gravity's torque, and d2E/dq2 adds to gravity's stiffness.

    Args:
        parent_point: m, fixed to the parent link, in the joint's frame.
        child_point: m, fixed to the child link, in the joint's frame at position zero.
        stiffness: N/m, of the spring.
        free_length: m, where the spring pulls nothing.
        force: N, a constant pull (a gas or hydraulic cylinder); a push is negative.
    """

    parent_point: Vector
    child_point: Vector
    stiffness: float = 0.0
    free_length: float = 0.0
    force: float = 0.0

    def torque_and_stiffness(self, axis: Vector, angle: float) -> tuple[float, float]:
        """What it adds to the torque the drive carries, and to that torque's slope.

        Args:
            axis: the joint's axis in the joint's frame, any length.
            angle: joint position, rad.

        Returns:
            dE/dq in N m and d2E/dq2 in N m/rad.
        """
        a = np.asarray(axis, dtype=float)
        a = a / np.linalg.norm(a)
        c = np.asarray(self.child_point)
        p = np.asarray(self.parent_point)
        along = a * (a @ c)
        across = c - along
        turned = across * np.cos(angle) + np.cross(a, across) * np.sin(angle)
        distance = float(np.linalg.norm(along + turned - p))
        if distance < 1e-9:  # the points meet: the pull has no direction, a spring no kink
            return 0.0, self.stiffness * float(across @ across)
        half_slope = -float(p @ np.cross(a, turned))  # d(d^2/2)/dq
        half_curvature = float(p @ turned) - float(a @ p) * float(a @ turned)
        rate = half_slope / distance
        rate_of_rate = (half_curvature - rate * rate) / distance
        pull = self.stiffness * (distance - self.free_length) + self.force
        return pull * rate, self.stiffness * rate * rate + pull * rate_of_rate


@dataclass(frozen=True)
class Shaft:
    """The round shaft whose torsion is the joint's spring, or a part of it.

    Args:
        radius: m.
        length: m, the part that twists.
        shear_modulus: Pa.
        sn_curve: name of its S-N curve in shear, or None.

    Raises:
        InputError: a size that is not positive and finite.
    """

    radius: float
    length: float
    shear_modulus: float
    sn_curve: str | None = None

    def __post_init__(self) -> None:
        for name in ("radius", "length", "shear_modulus"):
            value = getattr(self, name)
            if not 0.0 < value < math.inf:
                raise InputError("must be positive and finite", key=f"shaft.{name}", value=value)

    @property
    def polar_moment(self) -> float:
        """Polar moment of area Jp = pi r^4 / 2, m^4."""
        return 0.5 * math.pi * self.radius**4

    @property
    def torsional_stiffness(self) -> float:
        """G Jp / l, N m/rad (Nie et al. 2016, eq. 14-17)."""
        return self.shear_modulus * self.polar_moment / self.length


@dataclass(frozen=True)
class Joint:
    """A joint with a spring between its motor side and its link side.

    Args:
        name: as in the URDF.
        kind: "revolute" (continuous ones too) or "prismatic".
        stiffness: N m/rad, or N/m for a prismatic joint; with a curve, that at no load.
        damping_ratio: modal, dimensionless.
        shaft: the shaft in the drive, where it is known.
        reducer: a name of the reducer catalogue, where it is known.
        effort_limit: N m or N; infinite where there is none.
        lower: position limit, rad or m; -inf where there is none.
        upper: position limit, rad or m; inf where there is none.
        rotor_inertia: kg m^2, on the motor's own side of the gear, where it is known.
        gear_ratio: motor turns per joint turn, where it is known.
        stiffness_curve: stiffness against torque, where it is known.
        balancer: the gravity balancer, where there is one.
        estimated: the values are an estimate, not a measurement.
    """

    name: str
    kind: str
    stiffness: float
    damping_ratio: float
    shaft: Shaft | None = None
    reducer: str | None = None
    effort_limit: float = math.inf
    lower: float = -math.inf
    upper: float = math.inf
    rotor_inertia: float | None = None
    gear_ratio: float | None = None
    stiffness_curve: StiffnessCurve | None = None
    balancer: Balancer | None = None
    estimated: bool = False
