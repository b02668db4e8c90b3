"""The one rivet that a report and a scene show: where the verdict's part fares worst, in full."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from numpy.typing import ArrayLike

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.core.shown import Shown
from picchio.fatigue.counting.counter import rainflow
from picchio.fatigue.counting.cycles import Cycles
from picchio.fatigue.shaft_stress import shear_stress
from picchio.model.model import Model, ModelLike
from picchio.robot.joint import Joint
from picchio.studies.assessment.result import Assessment
from picchio.studies.rivet.pose import Rivet, SampledResponse
from picchio.studies.tasks import Operation, Task
from picchio.vibration.closed_form.modes import Modes
from picchio.vibration.closed_form.response import Response

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True, eq=False)
class WorstRivet(Shown):
    """A joint's worst rivet.

    Attributes:
        rivet: the model at the pose, under the operation's blows.
        joint: the one that governs the verdict.
        index: its row among the flexible joints.
        pose_number: counted from 1.
        rest: response to the burst; None where its ring-down goes on.
        steady: steady state; None where there is none.
    """

    PLOTS: ClassVar = {"stress": "visuals.plots.stress:plot_rivet_stress"}

    rivet: Rivet
    joint: Joint
    index: int
    pose_number: int
    rest: Response | SampledResponse | None
    steady: Response | SampledResponse | None

    @property
    def operation(self) -> Operation:
        """Of the task."""
        return self.rivet.operation

    @property
    def pose(self) -> FloatArray:
        """(nv,) rad or m."""
        return self.rivet.pose

    @property
    def modes(self) -> Modes:
        """At the pose, of the linear part of the model."""
        return self.rivet.modes

    @property
    def stiffness(self) -> float:
        """N m/rad, of the joint at the pose."""
        return float(self.rivet.stiffness[self.index])

    @property
    def static_torque(self) -> float:
        """N m, by gravity and feed force."""
        op = self.operation
        return float(self.rivet.static_torque(op.excitation, op.direction)[self.index])

    @property
    def response(self) -> Response | SampledResponse:
        """The burst where there is one, else the steady state."""
        found = self.rest if self.rest is not None else self.steady
        assert found is not None
        return found

    def stress_turning_points(self) -> tuple[FloatArray, FloatArray]:
        """The time (k,) s and shear stress (k,) Pa of the vibration's turning points.

        Raises:
            InputError: the joint has no shaft.
        """
        time, value = self.response.turning_points(self.operation.direction)[self.index]
        return time, self.stress_of(self.stiffness * value)

    def stress(self, time: ArrayLike) -> FloatArray:
        """The shear stress (k,) Pa of the vibration.

        Args:
            time: (k,) s from the first blow.

        Raises:
            InputError: the joint has no shaft.
        """
        deflection = self.response.deflection(time, self.operation.direction)[self.index]
        return self.stress_of(self.stiffness * deflection)

    def stress_of(self, torque: Any) -> Any:
        """The shear stress, Pa, that a torque brings into the shaft.

        Args:
            torque: N m, any shape.

        Raises:
            InputError: the joint has no shaft.
        """
        if self.joint.shaft is None:
            raise InputError("the joint has no shaft", key=self.joint.name)
        return shear_stress(torque, self.joint.shaft)

    def to_frame(self) -> pandas.DataFrame:
        """The cycles, as `cycles`."""
        return self.cycles().to_frame()

    def _seen(self) -> Mapping[str, Any]:
        op = self.operation
        return {
            "robot": self.rivet.model,
            "pose": self.pose,
            "excitation": op.excitation,
            "hits": op.hits_per_rivet,
        }

    def cycles(self) -> Cycles:
        """The cycles of the shear stress, Pa, counted with half cycles for the residue."""
        return rainflow(self.stress_turning_points()[1])


def worst_rivet(
    assessment: Assessment,
    robot: ModelLike,
    task: Task,
    *,
    gravity_stiffness: bool | None = None,
) -> WorstRivet:
    """Solve the worst rivet of an assessment again, to look at it.

    Args:
        assessment: of this robot on this task.
        robot: the robot, or a model of it.
        task: the task.
        gravity_stiffness: as in the assessment.

    Returns:
        the rivet's response at the joint that governs the verdict.

    Raises:
        InputError: as `assess`.
    """
    model = Model.of(robot, gravity_stiffness=gravity_stiffness)
    told = assessment.verdict
    operation = next(op for op in task.operations if op.name == told.operation)
    rivet = Rivet(model, operation, operation.poses[told.pose])
    index = model.robot.flexible_names.index(told.joint)
    found: list[Response | SampledResponse | None] = []
    for hits in (operation.hits_per_rivet, None):
        try:
            response = rivet.response_along(operation.excitation, hits, operation.direction)
            found.append(response if (rivet.modes.poles.real < 0.0).all() or not hits else None)
        except InputError:  # no steady state, or it rings on: the assessment has told
            found.append(None)
    return WorstRivet(
        rivet=rivet,
        joint=model.robot.flexible_joints[index],
        index=index,
        pose_number=told.pose + 1,
        rest=found[0],
        steady=found[1],
    )
