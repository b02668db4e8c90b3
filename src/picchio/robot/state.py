"""What the vibration stage needs of a robot at one pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RobotState:
    """The flexible joints' matrices at a pose; rigid joints stand still. Arrays are read-only.

    Args:
        pose: (nv,) rad or m, every movable joint.
        mass_matrix: (n, n) kg m^2, link side.
        jacobian: (3, n) m, of the point where the force acts, world axes.
        stiffness: (n,) N m/rad or N/m; with a stiffness curve, the slope at `gravity_torque`.
        gravity_torque: (n,) N m or N, that the springs carry at rest, balancers taken off.
        tool_position: (3,) m, the point where the force acts, world.
        tool_rotation: (3, 3), the tool frame's axes in the world.
    """

    pose: Array
    mass_matrix: Array
    jacobian: Array
    stiffness: Array
    gravity_torque: Array
    tool_position: Array
    tool_rotation: Array

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            getattr(self, name).setflags(write=False)
