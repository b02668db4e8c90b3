"""The motions of a redundant arm that leave the tool where it is.

An arm of seven joints that holds a point and a tool axis has two such motions left (the roll
about the axis and the elbow's swivel), an arm of six has one. All poses along them do the same
work with different vibration: a placement study chooses among them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from picchio.robot.ik.chain import Chain, tool_chain
from picchio.robot.ik.chain_kernel import forward
from picchio.robot.ik.kernel import relax

if TYPE_CHECKING:
    from picchio.robot.flexible_robot import FlexibleRobot

Array = NDArray[np.float64]
# Singular values of the task below this share of the largest are none.
_LEAST = 1e-6


def self_motion_basis(robot: FlexibleRobot, pose: ArrayLike) -> Array:
    """The orthonormal directions (nv, r) in which the joints can move, the tool standing still.

    Args:
        robot: the robot.
        pose: (nv,) rad or m.

    Raises:
        InputError: as `FlexibleRobot.pose`.
    """
    chain = tool_chain(robot)
    _, jacobian, _ = _task(chain, robot.pose(pose))
    _, values, rows = np.linalg.svd(jacobian)
    rank = int((values > _LEAST * values[0]).sum()) if len(values) else 0
    basis = np.zeros((robot.rigid.nv, len(chain.index) - rank))
    basis[chain.index] = rows[rank:].T
    return basis


def move_along_self_motion(robot: FlexibleRobot, pose: ArrayLike, towards: ArrayLike) -> Array:
    """The pose nearest to another that can be reached from `pose` with the tool standing still.

    Args:
        robot: the robot.
        pose: (nv,) where to start, within the limits.
        towards: (nv,) where to go as far as the tool allows.

    Returns:
        A pose (nv,) within the limits; a local optimum.

    Raises:
        InputError: as `FlexibleRobot.pose`.
    """
    chain = tool_chain(robot)
    start, goal = robot.pose(pose), robot.pose(towards)
    residual, _, weight = _task(chain, start)
    # The task of standing still: the target is where the tool is now.
    axis = residual[3:] / weight
    q = start[chain.index].copy()
    relax(chain.tables, q, goal[chain.index], chain.lower, chain.upper, residual[:3].copy(),
          axis, weight, 400)  # fmt: skip
    moved = start.copy()
    moved[chain.index] = q
    return moved


def _task(chain: Chain, pose: Array) -> tuple[Array, Array, float]:
    """The tool's place and weighted axis (6,), their Jacobian (6, k), and the axis's weight, m."""
    residual, jacobian = np.empty(6), np.empty((6, len(chain.index)))
    zero, weight = np.zeros(3), 0.3 * chain.reach
    forward(chain.tables, pose[chain.index], residual, jacobian, zero, zero, weight)
    return residual, jacobian, weight
