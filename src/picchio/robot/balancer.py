"""A gravity balancer: a spring or a cylinder beside a joint that carries part of the weight.

It pulls two points together, one fixed to the joint's parent link and one to its child link.
With the distance d(q) between them its energy is

    E(q) = k (d - d0)^2 / 2 + F d

so the drive carries dE/dq on top of gravity's torque, and d2E/dq2 adds to gravity's stiffness.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Balancer:
    """A spring and a constant force between two points of neighbouring links.

    Args:
        parent_point: m, fixed to the parent link, in the joint's frame.
        child_point: m, fixed to the child link, in the joint's frame at position zero.
        stiffness: N/m, of the spring.
        free_length: m, where the spring pulls nothing.
        force: N, a constant pull (a gas or hydraulic cylinder); a push is negative.
    """

    parent_point: Vector
    child_point: Vector
    stiffness: float = 0.0
    free_length: float = 0.0
    force: float = 0.0

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
