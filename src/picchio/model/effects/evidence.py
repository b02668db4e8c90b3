"""What the records of a campaign can show: by it an effect says where it may be at work."""

from __future__ import annotations

from dataclasses import dataclass

from picchio.model.effects.effect import TargetKind
from picchio.model.expansion import BASE_AXES
from picchio.robot.flexible_robot import FlexibleRobot


@dataclass(frozen=True, eq=False)
class Evidence:
    """What the records of one kind (percussion, or motion) can show.

    Attributes:
        robot: the robot.
        motion: whether the robot moves in these records, rather than being hit.
        groups: channel groups that sensors of the response read.
        vectors: those of them that read three axes.
        accelerations: those of them that read accelerations.
        forces: channel groups that sensors of the force read.
        bursts: whether a record has a burst of several blows.
        recorded: whether the force of every record was recorded together with the response.
        reshaped: whether some record's blows may have another shape than programmed.
        days: over which the records are spread; 0 where dates are not known.
        kelvin: over which their temperatures are spread; 0 where they are not known.
        driven: joints that move and whose drive's torque was recorded.
        wound: joints that move and that have encoders on both sides of the gear.
    """

    robot: FlexibleRobot
    motion: bool = False
    groups: tuple[str, ...] = ()
    vectors: frozenset[str] = frozenset()
    accelerations: frozenset[str] = frozenset()
    forces: tuple[str, ...] = ()
    bursts: bool = False
    recorded: bool = False
    reshaped: bool = False
    days: float = 0.0
    kelvin: float = 0.0
    driven: tuple[str, ...] = ()
    wound: tuple[str, ...] = ()

    def targets(self, kind: TargetKind) -> list[str]:
        """Every target of a kind.

        Args:
            kind: what an effect is about.

        Returns:
            names, in the robot's order.
        """
        if kind in ("joint", "joint or link"):
            return list(self.driven if self.motion else self.robot.flexible_names)
        if kind == "link":
            joints = self.robot.tree.joints
            return [joints[name].child for name in self.robot.joint_names if name in joints]
        if kind == "axis":
            return list(BASE_AXES)
        if kind == "channel group":
            return list(self.groups)
        return [kind]
