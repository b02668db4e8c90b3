"""A robot's kinematics about a pose, swept once for all that its links carry.

Whatever stands on a link, its inertia and gravity follow from how that point moves: M = J^T J and
g = -J^T a for 1 kg, with dg_i/dq_j = -a . (w_i x J_j) for a joint i that carries j (the derivatives
of a serial chain's Jacobian; Lynch and Park, Modern Robotics (2017), section 5.1.4).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin

from picchio.core.arrays import FloatArray, IndexArray

STEP = 1e-4  # rad or m, of the central differences


@dataclass(frozen=True, eq=False)
class Inertia:
    """Mass matrix and gravity about a pose, over c coordinates.

    Attributes:
        mass: (c, c) kg m^2.
        mass_gradient: (c, c, c), [k, i, j] = dM_ij/dq_k.
        gravity: (c,) N m, the torque that holds the arm.
        gravity_gradient: (c, c) N m/rad.
        gravity_curvature: (c, c, c), [k, i, j] = d2 g_i/dq_j dq_k.
    """

    mass: FloatArray
    mass_gradient: FloatArray
    gravity: FloatArray
    gravity_gradient: FloatArray
    gravity_curvature: FloatArray

    def take(self, columns: tuple[int, ...]) -> Inertia:
        """The same over some of the coordinates.

        Args:
            columns: indices of the coordinates that are kept.
        """
        kept = {name: own[np.ix_(*[columns] * own.ndim)] for name, own in vars(self).items()}
        return Inertia(**kept)


# [r, s, t]: (a x b)_r is the sum of this times a_s b_t.
CROSS = np.zeros((3, 3, 3))
for _r, _s, _t in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    CROSS[_r, _s, _t], CROSS[_r, _t, _s] = 1.0, -1.0


@dataclass(frozen=True, eq=False)
class Motion:
    """How a frame moves with c coordinates, to second order; world axes.

    Attributes:
        jacobian: (6, c), linear, then angular.
        gradient: (c, 6, c), [k, r, i] = dJ_ri/dq_k.
        rotation: (3, 3), the frame's axes at the pose.
    """

    jacobian: FloatArray
    gradient: FloatArray
    rotation: FloatArray

    def at(self, offset: FloatArray) -> Motion:
        """The motion of a point (3,) m fixed in the frame.

        Args:
            offset: (3,) m, from the frame's origin, in its axes.
        """
        lever = self.rotation @ offset
        angular = self.jacobian[3:]
        across = CROSS @ lever
        turned = across @ angular  # (3, c): the lever's change by each coordinate
        jacobian, gradient = self.jacobian.copy(), self.gradient.copy()
        jacobian[:3] += turned
        gradient[:, :3] += (
            across @ self.gradient[:, 3:] + (CROSS @ turned).T.swapaxes(1, 2) @ angular
        )
        return Motion(jacobian, gradient, self.rotation)

    def take(self, columns: list[int]) -> Motion:
        """The motion with some of the coordinates.

        Args:
            columns: indices of the coordinates that are kept.
        """
        return Motion(
            self.jacobian[:, columns],
            np.ascontiguousarray(self.gradient[np.ix_(columns, range(6), columns)]),
            self.rotation,
        )


@dataclass(frozen=True, eq=False)
class Swept:
    """Joints at a pose, and a step to either side along each of c coordinates.

    Attributes:
        jacobians: (1 + 2c, 6, nv) of all joints, linear at the world's origin, then angular.
        places: by the joint's number, its axes (1 + 2c, 3, 3) and origin (1 + 2c, 3) in the world.
        carrying: by the joint's number, (nv,) which joints move it.
        columns: (nv, c) which joints a coordinate moves.
        gravity: (3,) m/s^2.
    """

    jacobians: FloatArray
    places: dict[int, tuple[FloatArray, FloatArray]]
    carrying: dict[int, FloatArray]
    columns: FloatArray
    gravity: FloatArray

    @classmethod
    def of(cls, model: Any, columns: FloatArray, q: FloatArray, joints: set[int]) -> Swept:
        """Sweep a Pinocchio model.

        Args:
            model: whose joints have one number each.
            columns: as in the attributes.
            q: (nv,) rad or m.
            joints: numbers of those that carry something.

        Returns:
            what is asked for later comes from this.
        """
        data, count = model.createData(), 1 + 2 * columns.shape[1]
        jacobians = np.empty((count, 6, model.nv))
        places = {j: (np.empty((count, 3, 3)), np.empty((count, 3))) for j in joints}
        steps = [0.0 * q, *(sign * STEP * column for column in columns.T for sign in (1.0, -1.0))]
        for k, step in enumerate(steps):
            jacobians[k] = pin.computeJointJacobians(model, data, q + step)
            for joint, (axes, origin) in places.items():
                axes[k], origin[k] = data.oMi[joint].rotation, data.oMi[joint].translation
        carrying = {}
        for joint in joints:
            carrying[joint] = np.zeros(model.nv)
            moving = [model.joints[j].idx_v for j in model.supports[joint] if j > 0]
            carrying[joint][moving] = 1.0
        return cls(jacobians, places, carrying, columns, np.array(model.gravity.linear))

    def take(self, columns: tuple[int, ...]) -> Swept:
        """The same along some of the coordinates.

        Args:
            columns: indices of the coordinates that are kept.
        """
        kept = np.array([0, *(2 * k + side for k in columns for side in (1, 2))])
        places = {j: (axes[kept], origin[kept]) for j, (axes, origin) in self.places.items()}
        return replace(
            self,
            jacobians=self.jacobians[kept],
            places=places,
            columns=self.columns[:, list(columns)],
        )

    def moving(self, joint: int, point: FloatArray) -> FloatArray:
        """How a point that a joint carries moves with the joints, world axes.

        Args:
            joint: its number.
            point: (3,) m, in the joint's axes.

        Returns:
            (1 + 2c, 6, nv), linear, then angular.
        """
        axes, origin = self.places[joint]
        own = self.jacobians * self.carrying[joint]
        own[:, :3] += _across(own[:, 3:], (axes @ point + origin)[:, :, None])
        return own

    def motion(self, joint: int, axes: FloatArray, point: FloatArray) -> Motion:
        """How a frame that a joint carries moves.

        Args:
            joint: its number.
            axes: (3, 3) of the frame, in the joint's.
            point: (3,) m, its origin, in the joint's axes.
        """
        every = self._taken(self.moving(joint, point))
        return Motion(every[0], _slopes(every), self.places[joint][0][0] @ axes)

    def inertia(self, joint: int, point: FloatArray) -> Inertia:
        """What 1 kg at a point that a joint carries adds.

        Args:
            joint: its number.
            point: (3,) m, in the joint's axes.
        """
        own = self.moving(joint, point)
        linear, angular = own[:, :3], own[:, 3:]
        every = self._taken(linear)
        mass = every.swapaxes(1, 2) @ every
        # A joint that carries another has the smaller number.
        turned = _across(linear, self.gravity[:, None])
        upper = np.triu(-(angular.swapaxes(1, 2) @ turned))
        both = upper + np.triu(upper, 1).swapaxes(1, 2)
        slope = self._taken(self._taken(both).swapaxes(1, 2))
        gravity = -self.gravity @ every[0]
        return Inertia(mass[0], _slopes(mass), gravity, slope[0], _slopes(slope))

    @cached_property
    def _order(self) -> IndexArray | None:
        """(c,) the joint of each coordinate, where each moves one, and by as much as itself."""
        one = ((self.columns != 0.0).sum(axis=0) == 1) & (self.columns.sum(axis=0) == 1.0)
        return self.columns.argmax(axis=0) if one.all() else None

    def _taken(self, values: FloatArray) -> FloatArray:
        """(..., c) of the coordinates, from (..., nv) of the joints."""
        if self._order is not None:
            return values[..., self._order]
        return np.asarray(values @ self.columns)


def _slopes(every: FloatArray) -> FloatArray:
    """(c, ...) by central differences of what stands at the pose and at two steps each."""
    return (every[1::2] - every[2::2]) / (2.0 * STEP)


def _across(first: FloatArray, second: FloatArray) -> FloatArray:
    """Cross products along the last axis but one, of length 3."""
    (a, b, c), (x, y, z) = np.moveaxis(first, -2, 0), np.moveaxis(second, -2, 0)
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=-2)
