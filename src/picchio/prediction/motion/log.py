"""What a motion record holds, joint by joint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from picchio.campaign.campaign import Campaign
from picchio.campaign.record import Record
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError, warn_user
from picchio.robot.flexible_robot import FlexibleRobot

_STANDS = 0.01


@dataclass(frozen=True, eq=False)
class MotionLog:
    """One motion record.

    Attributes:
        file: what the record is called.
        rate: samples a second, Hz.
        angle: joint -> (m,) rad or m as measured: motor side where it was, else link side.
        group: joint -> the channel group of `angle`: "motor_position" or "position".
        torque: joint -> (m,) N m or N.
        link: joint -> (m,) link side, of joints that have both encoders.
        reference: joint -> (m,) as commanded.
        standing: joint without an angle -> rad or m where it is taken to stand.
        unknown: those of them of which nobody says where they stand.
    """

    file: str
    rate: float
    angle: Mapping[str, FloatArray]
    group: Mapping[str, str]
    torque: Mapping[str, FloatArray]
    link: Mapping[str, FloatArray]
    reference: Mapping[str, FloatArray]
    standing: Mapping[str, float] = field(default_factory=dict)
    unknown: tuple[str, ...] = ()

    @property
    def samples(self) -> int:
        """How many."""
        return next(iter(self.angle.values())).size

    @property
    def moving(self) -> tuple[str, ...]:
        """Joints that travel at least a hundredth of what the joint of the longest way does."""
        travel = {joint: float(np.ptp(angle)) for joint, angle in self.angle.items()}
        longest = max(travel.values())
        return tuple(joint for joint, way in travel.items() if way > _STANDS * longest > 0.0)


def read_log(robot: FlexibleRobot, record: Record) -> MotionLog:
    """Read a motion record.

    Raises:
        InputError: a joint that the robot does not have, or no joint's angle in the record.
    """
    roles: dict[str, dict[str, FloatArray]] = {"link": {}, "motor": {}, "torque": {},
                                               "reference": {}}  # fmt: skip
    wanted = {}
    for name in record.channels:
        channel = record.channel(name)
        if channel.kind.motion:
            wanted[name] = channel
        elif not channel.kind.unused:
            warn_user(
                f"{record.file}: {name} is not used: nothing predicts a {channel.kind.name} "
                "while the robot moves"
            )
    read = record.read(wanted)
    for name, channel in wanted.items():
        joint = channel.subject or ""
        if joint not in robot.joint_names:
            raise InputError("the robot has no joint of this name", file=record.source.path,
                             key=name, value=joint, choices=robot.joint_names)  # fmt: skip
        if channel.kind.motion == "torque" and np.ptp(read[name]) == 0.0:
            warn_user(f"{record.file}: {name} is not used: it reads one value all along")
            continue
        roles[channel.kind.motion][joint] = read[name]
    link, motor = roles["link"], roles["motor"]
    angle = {j: motor.get(j, link.get(j)) for j in robot.joint_names if j in motor or j in link}
    if not angle:
        raise InputError("the record has no joint's position", file=record.source.path,
                         key=record.file,
                         choices=["position.<joint>", "motor_position.<joint>"])  # fmt: skip
    standing = record.standing(robot)
    return MotionLog(
        file=record.file,
        rate=record.clock.rate,
        angle={joint: values for joint, values in angle.items() if values is not None},
        group={joint: "motor_position" if joint in motor else "position" for joint in angle},
        torque={joint: torque for joint, torque in roles["torque"].items() if joint in angle},
        link={joint: link[joint] for joint in link if joint in motor},
        reference=roles["reference"],
        standing={joint: at or 0.0 for joint, at in standing.items()},
        unknown=tuple(joint for joint, at in standing.items() if at is None),
    )


def read_logs(robot: FlexibleRobot, campaign: Campaign) -> list[MotionLog]:
    """All motion records of a campaign.

    Raises:
        InputError: there is none; as `read_log`.
    """
    logs = [read_log(robot, record) for record in campaign if record.kind == "motion"]
    if not logs:
        raise InputError("holds no motion record", file=campaign.folder, key="record.kind")
    return logs
