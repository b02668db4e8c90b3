"""What the nominal simulation leaves of motion records; no cause is looked for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from picchio.campaign.campaign import Campaign
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.diagnosis.motion.data.noise import noise_levels
from picchio.diagnosis.motion.data.system import Group, System
from picchio.diagnosis.motion.fit.least_squares import Fit, fit
from picchio.diagnosis.motion.fit.state import baseline
from picchio.model.motion import TORQUE, WINDUP
from picchio.prediction.motion.log import read_logs
from picchio.robot.flexible_robot import FlexibleRobot


@dataclass(frozen=True)
class GroupResidual:
    """One joint's torque or twist, all records together.

    Attributes:
        group: kind and joint.
        name: for people.
        unit: SI.
        measured, left, noise: RMS, SI.
    """

    group: Group
    name: str
    unit: str
    measured: float
    left: float
    noise: float

    @property
    def share(self) -> float:
        """Left over measured."""
        return self.left / self.measured if self.measured > 0.0 else float("nan")


@dataclass(frozen=True, eq=False)
class MotionResidual:
    """The nominal model fitted within its tolerance to all records, and what that leaves.

    Attributes:
        system: the equations of all records.
        fit: the rigid bodies' torques within their tolerance, and the friction that is stated.
        groups: torques and twists.
    """

    system: System
    fit: Fit
    groups: list[GroupResidual]


def motion_residual(robot: FlexibleRobot, campaign: Campaign) -> MotionResidual:
    """Fit the nominal model within the campaign's tolerance, and measure what is left.

    Args:
        robot: the nominal robot.
        campaign: its motion records; others are passed over.

    Raises:
        InputError: no record that can be predicted for this robot.
    """
    system = System(robot, read_logs(robot, campaign))
    kept = [g for g in system.groups if g[0] in (TORQUE, WINDUP)]
    if not kept:
        raise InputError("the records hold neither blows nor torque nor a second encoder",
                         file=campaign.folder, key="record")  # fmt: skip
    found = fit(system, baseline(system, campaign.tolerance.force))
    noise = noise_levels(system)
    groups = []
    for group in kept:
        kind, joint = group
        force, way = map(robot.tree.joints[joint].units.of, ("N*m", "rad"))
        parts = system.of(group)
        groups.append(GroupResidual(
            group, group_words(group), force if kind == TORQUE else way,
            rms(np.concatenate([s.measured for s in parts])),
            rms(np.concatenate([found.residual[s.rows] for s in parts])), noise.get(group, 0.0),
        ))  # fmt: skip
    return MotionResidual(system, found, groups)


def group_words(group: Group) -> str:
    """A group for people."""
    kind, joint = group
    return f"torque of {joint}" if kind == TORQUE else f"link angle less motor angle of {joint}"


def rms(rows: FloatArray) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(rows**2)))
