"""What the records of a campaign can show: by it an effect says where it may be at work."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from picchio.core.errors import InputError
from picchio.model.effects.effect import Effect, TargetKind
from picchio.model.expansion import BASE_AXES
from picchio.robot.flexible_robot import FlexibleRobot

_ANYWHERE: dict[TargetKind, Callable[[FlexibleRobot], Iterable[str]]] = {
    "joint": lambda robot: robot.joint_names,
    "joint pair": lambda robot: robot.joint_names[1:],
    "joint or link": lambda robot: (*robot.joint_names, *robot.tree.links),
    "link": lambda robot: robot.tree.links,
    "axis": lambda _: BASE_AXES,
    "tool": lambda _: ("tool",),
    "robot": lambda _: ("robot",),
}
LACKING = {
    "bursts": "no record has a burst of several blows",
    "programmed": "the force was recorded in every record",
    "recorded": "the force was not recorded in place of stated blows",
    "reshaped": "blows of a force that was measured have no other shape to turn into",
    "days": "the records are not of several known dates",
    "kelvin": "the records are not of several known temperatures",
    "posed": "some joints have no angle, and nobody says where they stand: state it as `pose`",
    "motion": "in blows it looks like a simpler effect, which is looked for; motions show it",
}
"""What an effect may take of the records (`Effect.takes`), and what is wrong without it."""


def check_target(effect: Effect, robot: FlexibleRobot) -> None:
    """Raise for a target that this robot does not have.

    Of a channel group, which is named like "accelerometer.tool" or "deflection", the frame is
    checked; whether it is measured only records tell.

    Args:
        effect: as read from a file.
        robot: that it is about.

    Raises:
        InputError: no such joint, link, axis or frame.
    """
    kind, target = effect.target_kind, effect.target
    if kind in _ANYWHERE:
        choices = _ANYWHERE[kind](robot)
    else:
        target, choices = target.partition(".")[2], ("", *robot.tree.links)
    if target not in choices:
        raise InputError(f"no such {kind}", key=f"{effect.name}.target", value=effect.target,
                         choices=[name for name in choices if name])  # fmt: skip


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
        unposed: joints that move and whose load depends on where joints without an angle stand.
        swept: joints that turn through so much in one record that a torque over the angle shows.
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
    swept: tuple[str, ...] = ()
    unposed: tuple[str, ...] = ()

    @property
    def programmed(self) -> bool:
        """Whether some record's blows are known only as programmed, and may have come otherwise."""
        return not self.recorded

    @property
    def posed(self) -> bool:
        """Whether it is known where all joints stand that others' loads depend on."""
        return not self.unposed

    def lacks(self, what: str) -> str:
        """Why these records cannot show an effect, one clause; empty where they can.

        Args:
            what: the effect takes: a key of `LACKING`, or nothing.
        """
        return LACKING[what] if what and not getattr(self, what) else ""

    def targets(self, kind: TargetKind, among: tuple[str, ...] = ("groups",)) -> list[str]:
        """Every target of a kind.

        Args:
            kind: what an effect is about.
            among: fields that name the channel groups that count, where it is about one.

        Returns:
            names, in the robot's order.
        """
        if kind in ("joint", "joint or link"):
            return list(self.driven if self.motion else self.robot.flexible_names)
        if kind == "joint pair":
            names = self.driven if self.motion else self.robot.flexible_names
            every = self.robot.joint_names
            return [b for a, b in itertools.pairwise(every) if a in names and b in names]
        if kind == "link":
            joints = self.robot.tree.joints
            return [joints[name].child for name in self.robot.joint_names if name in joints]
        if kind == "axis":
            return list(BASE_AXES)
        if kind == "channel group":
            wanted = {group for field in among for group in getattr(self, field)}
            return [group for group in (*self.groups, *self.forces) if group in wanted]
        return [kind]
