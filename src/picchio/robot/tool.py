"""What the robot carries: the tool, and the gun that strikes."""

from __future__ import annotations

from dataclasses import dataclass

from picchio.core.arrays import Vector

RECOIL_JOINT = "gun_recoil"


@dataclass(frozen=True)
class Tool:
    """The tool, held rigidly by a frame of the robot and counted once.

    Args:
        frame: the link that carries it; sensors "at the tool" sit at its origin.
        xyz: m, from the frame's origin to the point where the force acts, in the frame.
        axis: unit vector in the frame, the way the tool points: towards the workpiece.
        mass: kg, on top of what the URDF has.
        com: m, centre of mass in the frame.
        inertia: kg m^2 about the centre of mass, in the frame: ixx ixy ixz iyy iyz izz.
    """

    frame: str
    xyz: Vector = (0.0, 0.0, 0.0)
    axis: Vector = (0.0, 0.0, 1.0)
    mass: float = 0.0
    com: Vector = (0.0, 0.0, 0.0)
    inertia: tuple[float, ...] = (0.0,) * 6


@dataclass(frozen=True)
class Gun:
    """The percussive gun, whose body sits at the tool point.

    With a recoil spring its body slides along the tool's axis: the robot gets a prismatic
    flexible joint of its own, `gun_recoil`, and the force acts on the body. Without one the
    body is rigid with the tool.

    Args:
        mass: kg, of the body.
        recoil_stiffness: N/m, or None for a rigidly held gun.
        damping_ratio: of the recoil spring.
        feed_force: N, steady push along the blow; a task without `preload` may take it.
    """

    mass: float
    recoil_stiffness: float | None = None
    damping_ratio: float = 0.0
    feed_force: float = 0.0


@dataclass(frozen=True)
class Mounting:
    """How the robot is mounted in the world.

    Args:
        xyz: m, of the URDF's root link.
        rpy: rad, fixed-axis roll, pitch, yaw, as in a URDF.
        gravity: m/s^2, in the world.
    """

    xyz: Vector = (0.0, 0.0, 0.0)
    rpy: Vector = (0.0, 0.0, 0.0)
    gravity: Vector = (0.0, 0.0, -9.81)
