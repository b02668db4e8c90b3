"""What the robot carries, the tool and the gun that strikes, and how it stands."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from picchio.core.toml import Finite, FiniteVector, StrictModel
from picchio.robot.joint import DampingRatio, Stiffness
from picchio.robot.link import Mass, SixInertias
from picchio.robot.spread import with_spreads


@with_spreads
class Tool(StrictModel):
    """The tool, held rigidly by a frame of the robot, in addition to the URDF's own masses.

    Attributes:
        frame: the URDF frame that carries the tool; sensors "at the tool" sit at its origin.
        xyz: m, from the frame's origin to the point where the force acts, in the frame.
        axis: the way the tool points (towards the workpiece), in the frame, of any length; a loaded
            robot's has unit length.
        mass: kg, of the tool.
        com: m, centre of mass in the frame.
        inertia: kg m^2, about the centre of mass: ixx, ixy, ixz, iyy, iyz, izz.
        source: where the values come from.
    """

    frame: str = ""
    xyz: FiniteVector = (0.0, 0.0, 0.0)
    axis: FiniteVector = (0.0, 0.0, 1.0)
    mass: Mass = 0.0
    com: FiniteVector = (0.0, 0.0, 0.0)
    inertia: SixInertias = (0.0,) * 6
    source: str | None = None

    @model_validator(mode="after")
    def _can_be(self) -> Self:
        if not any(abs(part) > 1e-9 for part in self.axis):
            raise ValueError("the axis has length zero")
        if self.mass == 0 and any(self.inertia):
            raise ValueError("an inertia needs a mass")
        if self.mass == 0 and any(self.com):
            raise ValueError("a centre of mass needs a mass")
        return self


@with_spreads
class Gun(StrictModel):
    """The percussive tool's body, at the tool point.

    With a recoil spring its body slides along the tool's axis: the robot gets a prismatic
    flexible joint of its own, `gun_recoil`, and the force acts on the body. Without one the
    body is rigid with the tool.

    Attributes:
        mass: kg, of the body.
        recoil_stiffness: N/m, of the spring on which the body slides along the tool's axis; without
            it the body is fixed.
        damping_ratio: 1, of the body on its spring.
        feed_force: N, steady force along the direction, where the task gives no preload.
        source: where the values come from.
    """

    mass: Mass
    recoil_stiffness: Stiffness | None = None
    damping_ratio: DampingRatio = 0.0
    feed_force: Finite = 0.0
    source: str | None = None

    @model_validator(mode="after")
    def _recoiling_mass(self) -> Self:
        if self.recoil_stiffness is not None and self.mass == 0:
            raise ValueError("a recoil spring needs the gun's mass")
        if self.recoil_stiffness is None and self.damping_ratio > 0:
            raise ValueError("a damping ratio needs recoil_stiffness: without it the body is fixed")
        return self


@with_spreads
class Mounting(StrictModel):
    """How the robot stands.

    Attributes:
        xyz: m, of the base in the world.
        rpy: rad, roll, pitch and yaw of the base, about fixed axes as in a URDF.
        gravity: m/s^2, world.
        source: where the values come from.
    """

    xyz: FiniteVector = (0.0, 0.0, 0.0)
    rpy: FiniteVector = (0.0, 0.0, 0.0)
    gravity: FiniteVector = (0.0, 0.0, -9.81)
    source: str | None = Field(default=None, repr=False)
