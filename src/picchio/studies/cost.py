"""A cost for motion planners: how much of its joints a pose uses, and how that changes with it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.excitation.excitation import Excitation
from picchio.model.model import Model, ModelLike
from picchio.studies.instant import use_at
from picchio.studies.rivet.life_rules import curves_of
from picchio.studies.rivet.pose import need_springs
from picchio.vibration.closed_form.response import unit_vector

_STEP = 1e-5  # rad or m: of the central differences
_NORM = 12.0


class PoseCost:
    """The utilisation of the most used joint by a rivet at a pose, smoothed, and its gradient.

    With u_j the larger of joint j's fatigue utilisation and its drive's torque over the limit that
    binds, the cost is the norm (sum u_j^12)^(1/12): at most 23 % above the largest of six joints,
    and smooth where two joints change places. Below 1 no part is beyond its limit. It goes into a
    planner as a cost of the state (STOMP, CHOMP, a cost of MoveIt), or is minimised in the null
    space of the tool's task.

    Args:
        robot: or a model of it.
        direction: (3,) of the force on the robot, world; any length.
        excitation: the blows.
        hits: of a rivet.

    Raises:
        InputError: no flexible joint, or none with a shaft or a drive whose limits are known.
    """

    def __init__(
        self,
        robot: ModelLike,
        direction: ArrayLike,
        excitation: Excitation,
        hits: int = 12,
    ) -> None:
        self.model = Model.of(robot)
        joints = self.model.robot.flexible_joints
        need_springs(self.model.robot)
        self._curves = curves_of(self.model.robot)
        if not any(self._curves) and not any(joint.ratings for joint in joints):
            raise InputError("no joint has a shaft or a drive whose limits are known",
                             file=self.model.robot.source)  # fmt: skip
        self._direction, self._excitation, self._hits = unit_vector(direction), excitation, hits

    def batch(self, poses: ArrayLike) -> FloatArray:
        """The cost (p,) of many poses at once: for samplers such as STOMP.

        Args:
            poses: (p, nv) rad or m.
        """
        rows = np.require(poses, float, ("C", "W"))
        use = use_at(
            self.model, rows, self._direction, self._excitation, self._hits, self._curves
        )  # fmt: skip
        each = np.nan_to_num(np.fmax(use.fatigue, use.drives))
        return np.asarray((each**_NORM).sum(axis=1) ** (1.0 / _NORM))

    def __call__(self, pose: ArrayLike) -> tuple[float, FloatArray]:
        """The cost of a pose and its gradient, by central differences of the compiled kernel.

        Args:
            pose: (nv,) rad or m.

        Returns:
            the cost, and (nv,) 1/rad or 1/m.
        """
        q = self.model.robot.pose(pose)
        step = _STEP * np.eye(len(q))
        found = self.batch(np.vstack([q, q + step, q - step]))
        n = len(q)
        return float(found[0]), (found[1 : n + 1] - found[n + 1 :]) / (2.0 * _STEP)
