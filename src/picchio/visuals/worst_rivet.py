"""The one rivet that a report and a scene show: the limiting joint's worst pose, in full."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.fatigue.counting.counter import rainflow
from picchio.fatigue.counting.cycles import Cycles
from picchio.fatigue.shaft_stress import shear_stress
from picchio.model.model import Model
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.joint import Joint
from picchio.studies.assessment.result import Assessment
from picchio.studies.tasks import Operation, Task
from picchio.vibration.closed_form.modes import Modes, modal_analysis
from picchio.vibration.closed_form.response import Response, response_from_rest, steady_state


@dataclass(frozen=True, eq=False)
class WorstRivet:
    """A joint's worst rivet.

    Attributes:
        joint: the limiting joint, or without shafts the one that deflects most.
        index: its row among the flexible joints.
        operation: of the task.
        pose: (nv,) rad or m.
        pose_number: counted from 1.
        modes: at the pose.
        rest: response to the burst; None where its ring-down has no end.
        steady: steady state; None where there is none.
        stiffness: N m/rad, of the joint at the pose.
        static_torque: N m, by gravity and feed force.
    """

    joint: Joint
    index: int
    operation: Operation
    pose: FloatArray
    pose_number: int
    modes: Modes
    rest: Response | None
    steady: Response | None
    stiffness: float
    static_torque: float

    @property
    def response(self) -> Response:
        """The burst where there is one, else the steady state."""
        found = self.rest if self.rest is not None else self.steady
        assert found is not None
        return found

    def stress_turning_points(self) -> tuple[FloatArray, FloatArray]:
        """Time (k,) s and shear stress (k,) Pa of the vibration's turning points.

        Raises:
            InputError: the joint has no shaft.
        """
        if self.joint.shaft is None:
            raise InputError("the joint has no shaft", key=self.joint.name)
        time, value = self.response.turning_points(self.operation.direction)[self.index]
        return time, shear_stress(self.stiffness * value, self.joint.shaft)

    def cycles(self) -> Cycles:
        """Cycles of the shear stress, Pa, counted with half cycles for the residue."""
        return rainflow(self.stress_turning_points()[1])


def worst_rivet(
    assessment: Assessment,
    robot: FlexibleRobot,
    task: Task,
    *,
    gravity_stiffness: bool = False,
) -> WorstRivet:
    """Solve the worst rivet of an assessment again, to look at it.

    Args:
        assessment: of this robot on this task.
        robot: the robot.
        task: the task.
        gravity_stiffness: as in the assessment.
    """
    name = assessment.limiting_joint
    if name is None:
        name = max(assessment.joints, key=lambda joint: joint.peak_deflection).name
    life = assessment.joint(name)
    operation = next(op for op in task.operations if op.name == life.worst_operation)
    pose = operation.poses[life.worst_pose]
    index = robot.flexible_names.index(name)
    state = robot.state(pose)
    modes = modal_analysis(Model(robot, gravity_stiffness).linear_system(pose))
    damped = bool((modes.poles.real < 0.0).all())
    rest = response_from_rest(modes, operation.excitation, operation.hits_per_rivet)
    feed = operation.excitation.preload * (state.jacobian.T @ operation.direction)
    return WorstRivet(
        joint=robot.flexible_joints[index],
        index=index,
        operation=operation,
        pose=pose,
        pose_number=life.worst_pose + 1,
        modes=modes,
        rest=rest if damped else None,
        steady=steady_state(modes, operation.excitation),
        stiffness=float(np.asarray(state.stiffness)[index]),
        static_torque=float((feed - state.gravity_torque)[index]),
    )
