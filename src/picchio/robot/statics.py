"""What the flexible joints carry at rest, and how stiff they are under it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from picchio.robot.joint import Joint
from picchio.robot.urdf_tree import UrdfTree

Array = NDArray[np.float64]


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
    """Stiffness (n,) of n joints under a torque (n,): curves give their slope there."""
    return np.array(
        [
            joint.stiffness
            if joint.stiffness_curve is None
            else float(joint.stiffness_curve.tangent(load))
            for joint, load in zip(joints, torque, strict=True)
        ]
    )
