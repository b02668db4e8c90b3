"""Gravity: the torque that the joints hold, and the stress that it puts into their shafts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.paper.arm import poses_at
from picchio.paper.world import World


@dataclass(frozen=True, eq=False)
class Holding:
    """The arm at rest.

    Attributes:
        angle: (k,) rad, joint 2 from full down to full up, joint 3 straight.
        torque: (k, 3) N m, magnitude, to hold it.
        largest: (3,) N m over that sweep.
        share_held: share of the sweep in which joint 2's stated actuator is strong enough.
    """

    angle: FloatArray
    torque: FloatArray
    largest: FloatArray
    share_held: float


def holding_torque(world: World) -> Holding:
    """Torque against gravity with the arm stretched out, over joint 2's stated range."""
    limit = world.printed.arm.limits[1]
    angle = np.linspace(-limit, limit, 181)
    torque = np.abs([world.robot.gravity_torque([0.0, q, 0.0]) for q in angle])
    held = torque[:, 1] <= world.printed.arm.actuator_torques[1]
    return Holding(angle, torque, torque.max(axis=0), float(held.mean()))


def gravity_stress(world: World) -> FloatArray:
    """(15, 3) MPa, steady stress in the shafts at the rivets."""
    torque = np.array([world.robot.gravity_torque(pose) for pose in world.rivet_poses])
    factors = [
        joint.shaft.radius / joint.shaft.polar_moment if joint.shaft else np.nan
        for joint in world.robot.flexible_joints
    ]
    return np.asarray(np.abs(torque) * np.array(factors) / 1e6)


def path_bend(world: World, x: FloatArray) -> FloatArray:
    """(4, len(x)) rad: how far joint 3 must bend to reach Fig. 9's heights at each x."""
    points = [[(at, 0.0, z) for at in x] for z in world.printed.task.path_heights]
    return np.asarray(np.abs(poses_at(points)[..., 2]))
