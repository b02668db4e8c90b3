"""The flexible joints at a pose: their matrices, the torque they carry, how stiff they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from picchio.robot.joint import Joint
from picchio.robot.urdf.tree import UrdfTree

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RobotState:
    """The flexible joints' matrices at a pose; rigid joints stand still. Arrays are read-only.

    Args:
        pose: (nv,) rad or m, every movable joint.
        mass_matrix: (n, n) kg m^2, link side.
        jacobian: (3, n) m, of the point where the force acts, world axes.
        stiffness: (n,) N m/rad or N/m; with a stiffness curve, the slope at `gravity_torque`.
        gravity_torque: (n,) N m or N, that the springs carry at rest, less the balancers'.
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


def balancing(joints: Sequence[Joint], tree: UrdfTree, positions: Array) -> tuple[Array, Array]:
    """What gravity balancers add to the joints' static torque, and to its slope.

    Args:
        joints: the n flexible joints.
        tree: the robot, for the joints' axes.
        positions: (n,) rad.

    Returns:
        (n,) N m and (n,) N m/rad; zero where there is no balancer.
    """
    torque, stiffness = np.zeros(len(joints)), np.zeros(len(joints))
    for row, joint in enumerate(joints):
        if joint.balancer is not None:
            axis = tree.joints[joint.name].axis
            added = joint.balancer.torque_and_stiffness(axis, float(positions[row]))
            torque[row], stiffness[row] = added
    return torque, stiffness


def stiffness_at_torque(joints: Sequence[Joint], torque: Array) -> Array:
    """Stiffness (..., n) of n joints under torques (..., n): curves give their slope there."""
    found = np.empty(torque.shape)
    for k, joint in enumerate(joints):
        curve = joint.stiffness_curve
        found[..., k] = joint.stiffness if curve is None else curve.tangent(torque[..., k])
    return found
