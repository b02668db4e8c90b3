"""A flexible joint and the shaft in its drive."""

from __future__ import annotations

import math
from dataclasses import dataclass

from picchio.robot.balancer import Balancer
from picchio.robot.stiffness_curve import StiffnessCurve


@dataclass(frozen=True)
class Shaft:
    """The round shaft whose torsion is the joint's spring, or a part of it.

    Args:
        radius: m.
        length: m, the part that twists.
        shear_modulus: Pa.
        sn_curve: name of its S-N curve in shear, or None.
    """

    radius: float
    length: float
    shear_modulus: float
    sn_curve: str | None = None

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
