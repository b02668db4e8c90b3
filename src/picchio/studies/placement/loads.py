"""How much a rivet place uses up of each joint: damage, and utilisation where there is none."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.excitation.excitation import Excitation
from picchio.fatigue.shaft_stress import stress_per_torque
from picchio.fatigue.sn.curve import SNCurve
from picchio.model.model import Model
from picchio.robot.drives.reducer import Reducer
from picchio.robot.joint import Joint, Strength
from picchio.studies.rivet.poses import BatchDamage, damage_at
from picchio.studies.tasks import Task


@dataclass(frozen=True, eq=False)
class Loads:
    """What poses cost a robot on a task.

    Attributes:
        model: the robot, with stiffnesses, and its effects.
        task: its operations say blows and hits.
        curves: S-N curve of each of the n joints, or None.
        ratings: what each joint's drive bears: of its reducer, or an estimate, or None.

    Raises:
        InputError: nothing by which joints could be ranked.
    """

    model: Model
    task: Task
    curves: tuple[SNCurve | None, ...]
    ratings: tuple[Reducer | Strength | None, ...]

    def __post_init__(self) -> None:
        efforts = [joint.effort_limit for joint in self.joints]
        if self.by_effort and not np.isfinite(efforts).any():
            raise InputError(
                "no joint has a shaft, a reducer or an effort limit, so no place is better than "
                "another",
                file=self.model.robot.source,
                hint="give shafts or reducers in a sidecar",
            )

    @property
    def joints(self) -> tuple[Joint, ...]:
        """The n flexible joints."""
        return self.model.robot.flexible_joints

    @property
    def by_effort(self) -> bool:
        """No joint has a shaft or reducer: torque over the URDF's effort limit ranks them."""
        return not any(self.curves) and not any(self.ratings)

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
        used = found.amplitude * stress_per_torque(self.joints, 0.0) / allowable
        if not self.by_effort and not any(self.ratings):
            return np.asarray(used)
        held = found.many.gravity_torque()
        if blows.preload:
            jacobian = found.many.mass_and_jacobian()[1]
            held = held - blows.preload * np.einsum("pdn,pd->pn", jacobian, directions)
        peak = np.maximum(
            np.abs(found.stiffness * found.highest - held),
            np.abs(found.stiffness * found.lowest - held),
        )
        for j, (joint, ratings) in enumerate(zip(self.joints, self.ratings, strict=True)):
            if self.by_effort:
                used[:, j] = peak[:, j] / joint.effort_limit
            elif ratings is not None:
                shares = ratings.shares(peak[:, j], np.abs(held[:, j]))
                used[:, j] = np.maximum(used[:, j], np.max(list(shares.values()), axis=0))
        return np.asarray(used)
