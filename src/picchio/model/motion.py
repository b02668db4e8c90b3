"""A motion record as the model sees it: how the arm moved, and what its drives had to do for it.

Effects change it through a few methods; `picchio.prediction.motion` turns it into what the drives
and encoders should have read. All arrays are (m,), one number a sample of the record.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from picchio.core.arrays import FloatArray

TORQUE, ROTOR, RIPPLE, WINDUP = "torque", "rotor", "ripple", "windup"
_PASSING = 0.05  # s


@dataclass
class Motion:
    """One record's motion, and what effects add to it.

    Attributes:
        rate: samples a second, Hz.
        angle: joint -> rad or m, low-passed with zero phase.
        velocity: joint -> rad/s or m/s.
        acceleration: joint -> rad/s^2 or m/s^2.
        still: joint -> the speed below which it is taken to stand, rad/s or m/s.
        body: joint -> torque that the bodies take, N m or N: what the gear transmits.
        stiffness: joint -> as documented, N m/rad or N/m; only joints that have one.
        gear_ratio: joint -> motor turns per joint turn; 1 where it is not known.
        added: kind, joint and values of what effects add.
        gains: joint -> factor on what the drive reports.
        delays: channel group -> s.
        signs: `direction`, kept.
        tool: the tool frame.
        loads: frame -> joint -> (m, 10) torque for one of each of the ten numbers, as in
            `picchio.model.inertia`, of a body fixed in the frame.
        weight: joint -> torque that holds the bodies against gravity, N m: part of `body`.
        link: link -> (10,) those numbers of the link by the robot's files, in its frame.
    """

    rate: float
    angle: Mapping[str, FloatArray]
    velocity: Mapping[str, FloatArray]
    acceleration: Mapping[str, FloatArray]
    still: Mapping[str, float]
    body: dict[str, FloatArray]
    stiffness: Mapping[str, float]
    gear_ratio: Mapping[str, float]
    tool: str
    loads: Callable[[str], Mapping[str, FloatArray]]
    link: Callable[[str], FloatArray]
    weight: Callable[[], Mapping[str, FloatArray]] = dict
    added: list[tuple[str, str, FloatArray]] = field(default_factory=list)
    gains: dict[str, float] = field(default_factory=dict)
    delays: dict[str, float] = field(default_factory=dict)
    signs: dict[str, FloatArray] = field(default_factory=dict)

    def direction(self, joint: str) -> FloatArray:
        """The sign of the velocity, 1 or -1; 0 while the joint stands.

        A joint that only passes through zero speed does not stand.

        Args:
            joint: its name.
        """
        if joint not in self.signs:
            v = self.velocity[joint]
            slow = np.concatenate([[False], np.abs(v) <= self.still[joint], [False]])
            first, last = np.flatnonzero(np.diff(slow.astype(np.int8))).reshape(-1, 2).T
            sign = np.sign(v)
            for start, end in zip(first, last, strict=True):
                if end - start > _PASSING * self.rate:
                    sign[start:end] = 0.0
            self.signs[joint] = sign
        return self.signs[joint]

    def before(self, joint: str) -> str | None:
        """The joint before one in the robot's order; None of the first.

        Args:
            joint: its name.
        """
        names = list(self.velocity)
        place = names.index(joint)
        return names[place - 1] if place else None

    # What effects may do ---------------------------------------------------------------------

    def add_body_torque(self, joint: str, torque: FloatArray) -> None:
        """Add a torque that follows from the motion of masses, N m: the gear transmits it.

        Args:
            joint: its name.
            torque: (m,) N m or N.
        """
        self.body[joint] = self.body[joint] + torque

    def add_body(self, frame: str, ten: FloatArray) -> None:
        """Add the torques of a body that is fixed in a frame.

        Args:
            frame: of a link or the tool.
            ten: (10,) what the body is; see `picchio.model.inertia`.
        """
        for joint, load in self.loads(frame).items():
            self.add_body_torque(joint, load @ ten)

    def add(self, kind: str, joint: str, values: FloatArray) -> None:
        """Add to what a joint's drive or encoders read.

        Args:
            kind: of what is added: TORQUE, on the motor's side of the gear (friction, an offset);
                ROTOR, the torque of a rotor's motion, before the gear; RIPPLE, a torque that may be
                faster than the band in which the rest is judged; WINDUP, the link side's angle less
                the motor side's.
            joint: its name.
            values: (m,) N m or N; of WINDUP rad or m.
        """
        self.added.append((kind, joint, values))

    def scale_torque(self, joint: str, gain: float) -> None:
        """Let the drive report `gain` times its torque.

        Args:
            joint: its name.
            gain: of the torque sensor.
        """
        self.gains[joint] = self.gains.get(joint, 1.0) * gain

    def delay(self, group: str, seconds: float) -> None:
        """Let the channels of a group ("position", "motor_position", "torque") be late.

        Args:
            group: of channels.
            seconds: how late.
        """
        self.delays[group] = self.delays.get(group, 0.0) + seconds
