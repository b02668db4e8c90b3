"""How much a rivet place uses up of each joint: damage, and utilisation where there is none."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.excitation.excitation import Excitation
from picchio.fatigue.reducer import Reducer
from picchio.fatigue.sn.curve import SNCurve
from picchio.model.model import Model
from picchio.studies.rivet.poses import BatchDamage, damage_at, stress_per_torque
from picchio.studies.tasks import Task


@dataclass(frozen=True, eq=False)
class Loads:
    """What poses cost a robot on a task.

    Attributes:
        model: the robot, with stiffnesses, and its effects.
        task: its operations say blows and hits.
        curves: S-N curve of each of the n joints, or None.
        reducers: reducer of each joint, or None.
        by_effort: no joint has shaft or reducer: torque over the URDF's effort limit ranks them.
    """

    model: Model
    task: Task
    curves: tuple[SNCurve | None, ...]
    reducers: tuple[Reducer | None, ...]
    by_effort: bool

    @classmethod
    def of(
        cls,
        model: Model,
        task: Task,
        curves: tuple[SNCurve | None, ...],
        reducers: tuple[Reducer | None, ...],
    ) -> Loads:
        """The same, checked.

        Args:
            model: the robot with its effects.
            task: what it does.
            curves: an S-N curve a joint, or None.
            reducers: a reducer a joint, or None.

        Returns:
            the loads of this task.

        Raises:
            InputError: nothing by which joints could be ranked.
        """
        known = any(c is not None for c in curves) or any(r is not None for r in reducers)
        efforts = [joint.effort_limit for joint in model.robot.flexible_joints]
        if not known and not np.isfinite(efforts).any():
            raise InputError(
                "no joint has a shaft, a reducer or an effort limit, so no place is better than "
                "another",
                file=model.robot.source,
                hint="give shafts or reducers in a sidecar",
            )
        return cls(model, task, curves, reducers, not known)

    def at(
        self,
        operation: int,
        poses: FloatArray,
        directions: FloatArray,
        period: float | None = None,
        *,
        compiled: bool = True,
    ) -> tuple[FloatArray, FloatArray]:
        """The damage of a rivet, and utilisation, (p, n) each; damage of unknown joints is zero.

        Args:
            operation: its index in the task.
            poses: (p, nv) rad or m.
            directions: (p, 3) unit vectors of the force.
            period: s, of the blows instead of the operation's own.
            compiled: False takes the slow path, exact for every damping.
        """
        op = self.task.operations[operation]
        blows = op.excitation if period is None else op.excitation.with_period(period)
        found = damage_at(
            self.model, poses, directions, blows, op.hits_per_rivet, self.curves, compiled=compiled
        )
        return np.nan_to_num(found.damage), self._utilisation(found, poses, directions, blows)

    def _utilisation(
        self, found: BatchDamage, poses: FloatArray, directions: FloatArray, blows: Excitation
    ) -> FloatArray:
        allowable = np.array([np.inf if c is None else c.allowable for c in self.curves])
        used = found.amplitude * stress_per_torque(self.model.robot) / allowable
        if not self.by_effort and not any(self.reducers):
            return np.asarray(used)
        held = found.many.gravity_torque()
        if blows.preload:
            jacobian = found.many.mass_and_jacobian()[1]
            held = held - blows.preload * np.einsum("pdn,pd->pn", jacobian, directions)
        peak = np.maximum(
            np.abs(found.stiffness * found.highest - held),
            np.abs(found.stiffness * found.lowest - held),
        )
        for j, (joint, reducer) in enumerate(
            zip(self.model.robot.flexible_joints, self.reducers, strict=True)
        ):
            if self.by_effort:
                used[:, j] = peak[:, j] / joint.effort_limit
            elif reducer is not None:
                share = reducer_utilisation(reducer, peak[:, j], np.abs(held[:, j]))
                used[:, j] = np.maximum(used[:, j], share)
        return np.asarray(used)


def reducer_utilisation(reducer: Reducer, peak: FloatArray, held: FloatArray) -> FloatArray:
    """`Reducer.check_blows` for many torques (p,) N m at once."""
    limits = (
        reducer.repeated_peak_torque, reducer.momentary_peak_torque, reducer.ratcheting_torque,
    )  # fmt: skip
    bound = min((limit for limit in limits if limit is not None), default=math.inf)
    rated = reducer.rated_torque
    return np.maximum(peak / bound, 0.0 * held if rated is None else held / rated)
