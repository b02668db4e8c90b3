"""Equations of motion of small vibration to second order, with nonlinear elements."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from picchio.core.arrays import FloatArray
from picchio.model.geometry import Geometry
from picchio.model.linear_system import LinearSystem


class ElementKind(IntEnum):
    """What an element does."""

    BACKLASH = 0
    CUBIC = 1
    BOUC_WEN = 2
    COULOMB = 3
    CONTACT = 4
    BILINEAR = 5


@dataclass(frozen=True)
class Element:
    """One nonlinear element between the sides of a joint, or between tool and workpiece.

    It is a kind and at most six numbers, so that compiled code can take a list of them; the forces
    are in `picchio.vibration.integration.element_kernel`.

    Attributes:
        kind: what it does.
        parameters: BACKLASH: stiffness, gap, rest deflection, rest torque; CUBIC: N m/rad^3;
            BOUC_WEN: torque, yield deflection; COULOMB: torque, smoothing rate; CONTACT:
            stiffness, damping, preload; BILINEAR: more stiffness where positive, N m/rad. SI.
    """

    kind: ElementKind
    parameters: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class VibratingSystem:
    """M(x) x'' + Coriolis(x') + C x' + K x + gravity's curvature + elements = b(x) F(t).

    N coordinates: the flexible joints, then whatever effects let move.

    Attributes:
        coordinates: N names.
        mass: (N, N) kg m^2.
        mass_gradient: (N, N, N), [k, i, j] = dM_ij/dx_k.
        damping: (N, N) N m s/rad.
        stiffness: (N, N) N m/rad, gravity's included where it counts.
        gravity_curvature: (N, N, N), [k, i, j] = d2 g_i/dx_j dx_k.
        force_jacobian: (3, N) of the point where the force acts, world.
        force: (N,) generalised force per newton of the tool.
        force_gradient: (N, N), [i, k] = its change with coordinate k.
        deflections: (n, N), the joints' deflections from the coordinates.
        wide: which coordinates the robot's wide chain has.
        taken: where they stand there.
        elements: nonlinear ones.
        rows: (elements, N), what each acts along.
        geometry: kinematics at the pose.
    """

    coordinates: tuple[str, ...]
    mass: FloatArray
    mass_gradient: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    gravity_curvature: FloatArray
    force_jacobian: FloatArray
    force: FloatArray
    force_gradient: FloatArray
    deflections: FloatArray
    wide: tuple[int, ...]
    taken: tuple[int, ...]
    elements: tuple[Element, ...]
    rows: FloatArray
    geometry: Geometry

    def linear(self) -> LinearSystem:
        """The linear part, for a force along any direction at its point."""
        return LinearSystem(
            self.mass,
            self.damping,
            self.stiffness,
            self.force_jacobian.T,
            self.deflections,
            self.geometry.robot.flexible_names,
        )
