"""A rivet whose stiffness, damping, blows and force are varied many times.

A common factor on all stiffnesses, or on all damping ratios, moves the poles and leaves the mode
shapes alone: one modal analysis serves every variation, in compiled code. Where that does not hold
(something else yields, modes are coupled, an element is nonlinear) the model itself is varied and
solved anew.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.excitation.excitation import Excitation
from picchio.excitation.piecewise import PiecewiseForce
from picchio.fatigue.counting.counter import Residue
from picchio.fatigue.counting.cycles import Cycles
from picchio.fatigue.mean_stress import Rule
from picchio.fatigue.sn.curve import SNCurve
from picchio.model.effects.effect import Effect
from picchio.model.effects.structure.joint_stiffness import JointStiffness
from picchio.model.effects.structure.modal_damping import ModalDamping
from picchio.model.model import Model
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.joint import Joint
from picchio.studies.rivet.life_rules import curves_of
from picchio.studies.rivet.pose import JointLoad, Rivet
from picchio.studies.tasks import Task
from picchio.vibration.batch.turning_kernel import turns_from_rest
from picchio.vibration.closed_form.modes import Modes

_NEARLY_CRITICAL = 1.0 - 1e-6


class VariedRivet(Rivet):
    """A rivet, ready to be varied; arguments as of `Rivet`."""

    def varied(
        self,
        *,
        stiffness: float = 1.0,
        damping: float = 1.0,
        width: float = 1.0,
        force: float = 1.0,
        hits: int | None = None,
        compiled: bool = True,
    ) -> tuple[JointLoad, ...]:
        """Every joint's load from rest with some inputs multiplied by a factor.

        The torque before the first blow stays as it is.

        Args:
            stiffness: factor on the stiffness of all joints.
            damping: factor on all modal damping ratios.
            width: factor on the width of the blows.
            force: factor on the force of the blows.
            hits: blows of the rivet, if others than the operation's.
            compiled: False always solves the varied model anew: the oracle.

        Raises:
            InputError: blows without a width to vary, a mode without damping.
        """
        op = self.operation
        count = op.hits_per_rivet if hits is None else hits
        blows = op.excitation.scaled(force=force, width=width)
        if compiled and self._fast is not None:
            turns = self._fast.turns(stiffness, damping, _force(self.model, blows, count))
            if turns is not None:
                return tuple(
                    replace(
                        load,
                        rest=turn,
                        static=load.static / stiffness,
                        stiffness=load.stiffness * stiffness,
                    )
                    for load, turn in zip(self.joint_loads(None), turns, strict=True)
                )
        model = self._varied_model(stiffness, damping)
        changed = replace(op, excitation=blows, hits_per_rivet=count)
        rivet = Rivet(model, changed, self.pose, self.geometry if self.plant else None)
        return rivet.loads("rest", both=False)

    def _varied_model(self, stiffness: float, damping: float) -> Model:
        effects: list[Effect] = []
        if stiffness != 1.0:
            names = self.model.robot.flexible_names
            effects += [JointStiffness(name, scale=stiffness) for name in names]
        if damping != 1.0:
            effects.append(ModalDamping("robot", scale=damping))
        if not effects:
            return self.model
        return replace(self.model, effects=(*self.model.effects, *effects))

    @cached_property
    def _fast(self) -> FastRest | None:
        """The compiled path; None where the model needs the exact one."""
        if self.nonlinear or self.model.gravity_stiffness:
            return None
        if self.plant is not None and not self.plant.joints_only:
            return None
        # Every mode must be an oscillator of its own that swings and dies.
        ratio = self.modes.damping_ratios
        if not (self.modes.decoupled and ((ratio > 0.0) & (ratio < _NEARLY_CRITICAL)).all()):
            return None
        return FastRest(self.modes, self.operation.direction)


@dataclass(frozen=True)
class ShaftStress:
    """How the joints that have a shaft and a curve turn their loads into stress cycles.

    Attributes:
        joints: k of them.
        columns: their places among the robot's flexible joints.
        curves: their S-N curves.
        residue: rainflow's rule for cycles that do not close.
        mean_stress: the correction.
    """

    joints: list[Joint]
    columns: list[int]
    curves: list[SNCurve]
    residue: Residue
    mean_stress: Rule

    @classmethod
    def of(
        cls,
        robot: FlexibleRobot,
        sn_curve: str | SNCurve | None,
        survival: float | None = None,
        residue: Residue = "half-cycles",
        mean_stress: Rule = "none",
    ) -> ShaftStress:
        """Of a robot; arguments as in `assess`, and `survival` to move the curves to.

        Raises:
            InputError: no joint with a shaft; a curve without scatter where a survival is given.
        """
        curves = curves_of(robot, sn_curve)
        columns = [j for j, curve in enumerate(curves) if curve is not None]
        if not columns:
            raise InputError(
                "no joint has a shaft and an S-N curve", file=robot.source, key="shaft"
            )
        used = [curve for curve in curves if curve is not None]
        if survival is not None:
            used = [curve.at_survival(survival) for curve in used]
        joints = [robot.flexible_joints[j] for j in columns]
        return cls(joints, columns, used, residue, mean_stress)

    def cycles(self, loads: Sequence[JointLoad]) -> list[tuple[Cycles, float]]:
        """Each joint's cycles of shear stress about zero, Pa, and its steady stress, Pa."""
        return [
            (loads[column].stress_cycles(joint, self.residue), loads[column].static_stress(joint))
            for joint, column in zip(self.joints, self.columns, strict=True)
        ]


def rivets_of(model: Model, task: Task) -> list[tuple[VariedRivet, float]]:
    """Every rivet place of a task in its order, and how many rivets a pass sets there."""
    return [
        (VariedRivet(model, operation, pose), operation.rivets)
        for operation in task.operations
        for pose in operation.poses
    ]


@lru_cache(maxsize=256)
def _force(model: Model, excitation: Excitation, hits: int) -> PiecewiseForce:
    """The blows as a force history: the same at many poses."""
    return model.force(excitation, hits)


class FastRest:
    """The turning points from rest, for one direction; exact to 1e-7 of the largest.

    Attributes:
        omega: (n,) rad/s, undamped.
        ratio: (n,) damping ratios.
        weights: (m, n) deflection of each joint per mode, 1/kg: of a mode whose equation is
            eta'' + 2 zeta omega eta' + omega^2 eta = F.
    """

    def __init__(self, modes: Modes, direction: FloatArray) -> None:
        along = modes.residues @ direction
        self.omega = np.abs(modes.poles)
        self.ratio = -modes.poles.real / self.omega
        self.weights = np.ascontiguousarray(-along.imag * modes.poles.imag)

    def turns(
        self, stiffness: float, damping: float, force: PiecewiseForce
    ) -> list[FloatArray] | None:
        """Every joint's deflection at rest, at its turns and at the end of the ring-down, rad.

        Args:
            stiffness: factor on all stiffnesses.
            damping: factor on all damping ratios.
            force: a burst, its last piece endless.

        Returns:
            m arrays; None where the damping reaches critical, or the ring-down is too long.
        """
        ratio = damping * self.ratio
        if ratio.max() >= _NEARLY_CRITICAL:
            return None
        omega = math.sqrt(stiffness) * self.omega
        poles = omega * (-ratio + 1j * np.sqrt(1.0 - ratio**2))
        turns, count = turns_from_rest(
            poles, self.weights, np.full(len(self.weights), -1.0), force.duration, force.constant,
            force.slope, force.amplitude, force.angular_frequency,
        )  # fmt: skip
        if not turns.size:
            return None
        return [row[:k] for row, k in zip(turns, count, strict=True)]
