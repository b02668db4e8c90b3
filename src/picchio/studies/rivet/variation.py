"""A rivet struck harder or more often, and how loads become the stress of what wears."""

from __future__ import annotations

from dataclasses import dataclass, replace

from picchio.core.errors import InputError
from picchio.fatigue.counting.counter import Residue
from picchio.fatigue.mean_stress import Rule
from picchio.fatigue.sn.curve import SNCurve
from picchio.model.model import Model
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.joint import Joint
from picchio.studies.rivet.life_rules import curves_of
from picchio.studies.rivet.pose import JointLoad, Rivet
from picchio.studies.tasks import Task

_NEARLY_CRITICAL = 1.0 - 1e-6


class VariedRivet(Rivet):
    """A rivet, ready to be struck harder or more often; arguments as of `Rivet`."""

    def varied(self, *, force: float = 1.0, hits: int | None = None) -> tuple[JointLoad, ...]:
        """Every joint's load from rest.

        The torque before the first blow stays as it is.

        Args:
            force: factor on the force of the blows.
            hits: blows of the rivet, if others than the operation's.

        Raises:
            InputError: a mode without damping.
        """
        op = self.operation
        count = op.hits_per_rivet if hits is None else hits
        changed = replace(op, excitation=op.excitation.scaled(force=force), hits_per_rivet=count)
        rivet = Rivet(self.model, changed, self.pose, self.geometry if self.plant else None)
        return rivet.loads("rest", both=False)


@dataclass(frozen=True)
class WornParts:
    """How the joints that have a shaft or a drive, and its curve, turn loads into cycles.

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
        *,
        needed: bool = True,
    ) -> WornParts:
        """Of a robot; arguments as in `assess`, and `survival` to move the curves to.

        `needed` refuses a robot of which no joint has such a part.

        Raises:
            InputError: no joint with one; a curve without scatter where a survival is given.
        """
        curves = curves_of(robot, sn_curve)
        columns = [j for j, curve in enumerate(curves) if curve is not None]
        if needed and not columns:
            raise InputError(
                "no joint has a shaft or a drive with a curve", file=robot.source, key="shaft"
            )
        used = [curve for curve in curves if curve is not None]
        if survival is not None:
            used = [curve.at_survival(survival) for curve in used]
        joints = [robot.flexible_joints[j] for j in columns]
        return cls(joints, columns, used, residue, mean_stress)


def rivets_of(model: Model, task: Task) -> list[tuple[VariedRivet, float]]:
    """Every rivet place of a task in its order, and how many rivets a pass sets there."""
    return [
        (VariedRivet(model, operation, pose), operation.rivets)
        for operation in task.operations
        for pose in operation.poses
    ]
