"""A flexible joint and its drive: shaft, stiffness curve, gravity balancer."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import AfterValidator, model_validator

from picchio.core.arrays import Vector
from picchio.core.toml import Finite, FiniteVector, Name, NotNegative, Positive, StrictModel
from picchio.robot.ratings import Ratings
from picchio.robot.spread import with_spreads
from picchio.robot.units import JointUnits, units_of

if TYPE_CHECKING:
    from picchio.robot.drives.reducer import Reducer

LONGEST_SHAFT = 2.0  # m: no arm has a longer one, a number beyond it is in millimetres
LEAST_DAMPED, MOST_DAMPED = 1e-4, 100.0  # 1: no built drive rings longer; 1 is critical
SOFTEST, STIFFEST = 1e-3, 1e12  # N m/rad or N/m: far beyond any drive on either side


def _in_metres(value: float) -> float:
    if value > LONGEST_SHAFT:
        raise ValueError(f"is above {LONGEST_SHAFT:g} m (in metres?)")
    return value


def _in_newtons(value: float) -> float:
    if not SOFTEST <= value <= STIFFEST:
        raise ValueError(
            f"is outside {SOFTEST:g} to {STIFFEST:g} N m/rad (N/m for a prismatic joint)"
        )
    return value


def _damps(value: float) -> float:
    if value != 0.0 and not LEAST_DAMPED <= value <= MOST_DAMPED:
        raise ValueError(f"is neither 0 (undamped) nor within {LEAST_DAMPED:g} to {MOST_DAMPED:g}")
    return value


DampingRatio = Annotated[NotNegative, AfterValidator(_damps)]
ShaftLength = Annotated[Positive, AfterValidator(_in_metres)]
Stiffness = Annotated[Positive, AfterValidator(_in_newtons)]


class StiffnessCurve(StrictModel):
    """Stiffness that grows with the torque, as catalogues of strain-wave gears give it.

    Wind-up against torque is three straight lines (for example Harmonic Drive, *Engineering data
    HFUC*, "torsional stiffness"). Small vibration about the pose's gravity torque sees the slope
    there, so the model takes the tangent.

    Attributes:
        k1: N m/rad, below the torque t1.
        k2: N m/rad, from t1 to t2.
        k3: N m/rad, above t2.
        t1: N m, first corner.
        t2: N m, second corner; above t1.
    """

    k1: Stiffness
    k2: Stiffness
    k3: Stiffness
    t1: Positive
    t2: Positive

    @model_validator(mode="after")
    def _corners_ascend(self) -> Self:
        if self.t2 <= self.t1:
            raise ValueError(f"t2 must be above t1 = {self.t1:g}, it is {self.t2:g}")
        return self

    def tangent(self, torque: ArrayLike) -> NDArray[np.float64]:
        """The slope at a torque, N m/rad; at a corner that of the line below it.

        Args:
            torque: N m, any shape.
        """
        size = np.abs(np.asarray(torque, dtype=float))
        return np.where(size <= self.t1, self.k1, np.where(size <= self.t2, self.k2, self.k3))


@with_spreads
class Balancer(StrictModel):
    """A gravity balancer: a spring or cylinder beside a joint that carries part of the weight.

    It pulls two points together, one fixed to the joint's parent link and one to its child link.
    With the distance d(q) between them its energy is E(q) = k (d - d0)^2 / 2 + F d, so the drive
    carries dE/dq on top of gravity's torque, and d2E/dq2 adds to gravity's stiffness.

    Attributes:
        parent_point: m, on the parent link, in the joint's frame at position zero.
        child_point: m, on the child link, in the joint's frame at position zero.
        stiffness: N/m, of the spring.
        free_length: m, of the unloaded spring.
        force: N, constant pull beside the spring (of a gas or hydraulic cylinder).
    """

    parent_point: FiniteVector
    child_point: FiniteVector
    stiffness: NotNegative = 0.0
    free_length: NotNegative = 0.0
    force: Finite = 0.0

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


@with_spreads
class Shaft(StrictModel):
    """The round solid shaft whose torsion is the joint's spring, or a part of it.

    Attributes:
        radius: m, at most 2.
        length: m, at most 2; used to check that k = G Jp / l.
        shear_modulus: Pa, 79.3e9 for steel.
        sn_curve: name of a shipped S-N curve, or a `picchio-sn-curve/1` file.
    """

    radius: ShaftLength
    length: ShaftLength
    shear_modulus: Positive
    sn_curve: Name | None = None

    @property
    def polar_moment(self) -> float:
        """Polar moment of area Jp = pi r^4 / 2, m^4."""
        return 0.5 * math.pi * self.radius**4

    @property
    def torsional_stiffness(self) -> float:
        """G Jp / l, N m/rad (Nie et al. 2016, eq. 14-17)."""
        return self.shear_modulus * self.polar_moment / self.length


@with_spreads
class Strength(StrictModel, Ratings):
    """What a drive bears, where its reducer is not known: an estimate of ratings and fatigue.

    Attributes:
        repeated_peak_torque: N m, limit of peaks that belong to the duty, of gravity and blows
            together; the torque-life curve counts in shares of it.
        rated_torque: N m, for which a life is stated at speed; for information, no limit at
            standstill.
        momentary_peak_torque: N m, limit for emergencies.
        life_curve: name of a shipped torque-life curve, or a `picchio-sn-curve/1` file.
        estimated: true if the values were not read from a catalogue: a factor of 2 where no
            spread is given.
        source: where the values come from, if not from where the joint's do.
    """

    repeated_peak_torque: Positive
    rated_torque: Positive | None = None
    momentary_peak_torque: Positive | None = None
    life_curve: Name | None = None
    estimated: bool | None = None
    source: str | None = None


ESTIMATED_DRIVE = "drive (estimated)"
# The spring on which a gun's body slides.
RECOIL_JOINT = "gun_recoil"


def is_drive(name: str) -> bool:
    """Whether a flexible joint is one of the robot's: a gun's recoil spring is part of the tool.

    Args:
        name: of the joint.
    """
    return name != RECOIL_JOINT


@dataclass(frozen=True)
class Joint:
    """A joint with a spring between its motor side and its link side.

    Args:
        name: as in the URDF.
        kind: "revolute" (continuous ones too) or "prismatic".
        stiffness: N m/rad, or N/m for a prismatic joint; with a curve, that at no load.
        damping_ratio: modal, dimensionless.
        shaft: the shaft in the drive, where it is known.
        reducer: its reducer, where it is known.
        strength: what the drive probably bears, where its reducer is not known.
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
    reducer: Reducer | None = None
    strength: Strength | None = None
    effort_limit: float = math.inf
    lower: float = -math.inf
    upper: float = math.inf
    rotor_inertia: float | None = None
    gear_ratio: float | None = None
    stiffness_curve: StiffnessCurve | None = None
    balancer: Balancer | None = None
    estimated: bool = False

    @property
    def units(self) -> JointUnits:
        """How its values are written."""
        return units_of(self.kind)

    @property
    def ratings(self) -> Reducer | Strength | None:
        """What says how much torque its drive bears: the reducer, else an estimate."""
        return self.reducer or self.strength

    @property
    def drive(self) -> str:
        """What to call that."""
        return f"reducer {self.reducer.name}" if self.reducer else ESTIMATED_DRIVE

    @property
    def worn(self) -> Shaft | Strength | None:
        """The part whose fatigue is counted: its shaft, else the drive as a whole."""
        return self.shaft or self.strength

    @property
    def per_torque(self) -> float:
        """What a unit torque brings in that part; NaN without one.

        1/m^3 in a shaft: shear stress, r / Jp. 1/(N m) in a drive: share of the torque for
        repeated peaks.
        """
        if self.shaft is not None:
            return self.shaft.radius / self.shaft.polar_moment
        if self.strength is not None:
            return 1.0 / self.strength.repeated_peak_torque
        return math.nan
