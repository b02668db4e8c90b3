"""What a planned test is, and what a kind of test must say of itself."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from picchio.campaign.tables import Tolerance
from picchio.core.arrays import FloatArray
from picchio.diagnosis.planning.outcome import Outcome
from picchio.robot.flexible_robot import FlexibleRobot

REACH = (0.2, 2.0)
"""m above the floor, z = 0: where a person who stands beside it sets up a gauge, or strikes."""


@dataclass(frozen=True, eq=False)
class Possible:
    """A record that could be taken.

    Attributes:
        kind: of the test.
        place: number of the pose among those tried.
        pose: (nv,) rad or m.
        direction: (3,) unit, world, of the pull or the blow.
        force: N.
        reads: (3,) unit, world, along which the instrument reads; None where it reads all axes.
        setting: what must be set up anew for it at its pose; equal ones are set up once.
        frame: that carries the sensor; None: the tool's.
    """

    kind: str
    place: int
    pose: FloatArray
    direction: FloatArray
    force: float
    reads: FloatArray | None
    setting: tuple[object, ...]
    frame: str | None = None


@dataclass(frozen=True, eq=False)
class Offered:
    """Records of one kind that could be taken, and what each would tell.

    Attributes:
        test: the kind.
        each: c records.
        names: k numbers that are never exact, beside stiffness and damping.
        slopes: (c, s, r, 2 n + k) of r readings by all numbers, at each of the outcome's s drawn
            robots, over the readings' own deviations.
    """

    test: Test
    each: tuple[Possible, ...]
    names: tuple[str, ...]
    slopes: FloatArray


class Test(ABC):
    """A kind of test that can be planned.

    Attributes:
        name: as a campaign calls the kind of its records.
        loads: instruments, one of which is needed to load the arm.
        reads: instruments, one of which is needed to read what it does.
        seconds: for a new pose, for setting up anew at it, and for the record itself.
        least: records, below which linear slopes tell too little of what may be wrong: noise and
            outliers, or which mode is which.
        file: of a record in the campaign; with a place for its number if each has its own.
    """

    name: ClassVar[str]
    loads: ClassVar[frozenset[str]]
    reads: ClassVar[frozenset[str]]
    seconds: ClassVar[tuple[float, float, float]]
    least: ClassVar[int]
    file: ClassVar[str]

    def possible(self, instruments: Sequence[str]) -> bool:
        """Whether these instruments suffice.

        Args:
            instruments: by name.
        """
        return bool(self.loads.intersection(instruments) and self.reads.intersection(instruments))

    @abstractmethod
    def candidates(
        self,
        robot: FlexibleRobot,
        poses: FloatArray,
        outcome: Outcome,
        force: float,
        instruments: Sequence[str],
        tolerance: Tolerance,
    ) -> Offered:
        """All records of this kind at some poses.

        Args:
            robot: flexible.
            poses: (m, nv) rad or m.
            outcome: at whose drawn robots they are looked at.
            force: N, at most.
            instruments: at hand.
            tolerance: how exact everything is.
        """

    @abstractmethod
    def row(
        self, robot: FlexibleRobot, one: Possible, instruments: Sequence[str]
    ) -> dict[str, object]:
        """A line of the form to fill in, by header; empty where a record has no form.

        Args:
            robot: flexible.
            one: the record.
            instruments: at hand.
        """

    @abstractmethod
    def table(self, robot: FlexibleRobot, one: Possible) -> dict[str, object]:
        """What the campaign says of a record, besides file and kind.

        Args:
            robot: flexible.
            one: the record.
        """


def angles(robot: FlexibleRobot, pose: FloatArray) -> dict[str, tuple[float, str]]:
    """A pose as people set it: of every joint a value and "deg" or "mm".

    Args:
        robot: whose pose it is.
        pose: (nv,) rad or m.
    """
    found = {}
    for name, value in zip(robot.joint_names, pose, strict=True):
        scale, unit = told_in(robot, name)
        found[name] = (round(float(value) * scale, 4) + 0.0, unit)
    return found


def within_reach(robot: FlexibleRobot, pose: FloatArray, frame: str | None = None) -> bool:
    """Whether a person can set up a gauge, or strike, at a frame: 0.2 to 2 m above the floor.

    Args:
        robot: at its mounting.
        pose: (nv,) rad or m.
        frame: the tool's where None.
    """
    down = np.array(robot.mounting.gravity, dtype=float)
    place = robot.frame_placement(pose, frame or robot.tool_frame)[0]
    low, high = REACH
    return bool(low <= -place @ down / np.linalg.norm(down) <= high)


def told_in(robot: FlexibleRobot, joint: str) -> tuple[float, str]:
    """What a joint's position is told in: so many of the unit are one radian or metre.

    Args:
        robot: whose joint it is.
        joint: its name.
    """
    own = robot.tree.joints.get(joint)
    slides = own is None or own.type == "prismatic"
    return (1000.0, "mm") if slides else (180.0 / math.pi, "deg")


def along(direction: FloatArray) -> str:
    """A direction in words: "+x"; "+x +y" for halfway between; or its components.

    Args:
        direction: (3,) unit, world.
    """
    signs = {
        axis: "+" if x > 0.0 else "\N{MINUS SIGN}" for axis, x in zip("xyz", direction, strict=True)
    }
    parts = [f"{signs[axis]}{axis}" for axis, x in zip("xyz", direction, strict=True)
             if abs(x) > 1e-6]  # fmt: skip
    sizes = [abs(x) for x in direction if abs(x) > 1e-6]
    if max(sizes) - min(sizes) > 1e-3:
        return "(" + ", ".join(f"{x:.2f}" for x in direction) + ")"
    return " ".join(parts)
