"""Swapped or flipped joints in motion records, by signals that follow from one another.

A position's derivative is the velocity; the motor side follows the link side; the torque carries
gravity and the masses: M(q) a + g(q), with the rest (friction, products of velocities) small.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.measurement.noise.window import Window
from picchio.measurement.quality.check import Check, Context, Finding
from picchio.measurement.quality.relabel import cosines
from picchio.measurement.quality.scan import RecordScan

_SAMPLES = 400
_SMOOTH = 0.05
_FEWEST = 50


class MotionAxesCheck(Check):
    """Positions, velocities and torques of motion records against one another.

    By joint's number and torque's channel it keeps what was seen and what all joints must show.
    """

    name = "joints"
    of = "motion"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        # Joints whose load depends on where nobody knows others stand.
        self._rests: set[str] = set()

    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """Velocity, motor and reference against position; torques are kept for the end."""
        window = scan.window
        roles = _roles(window)
        # The link side where it is known, else the motor side.
        joints = {j: window.arrays[n] for j, n in (roles["motor"] | roles["link"]).items()}
        for joint, position in joints.items():
            for role in ("motor", "reference"):
                name = roles[role].get(joint)
                if name is not None and window.arrays[name] is not position:
                    what = f"position of {joint}"
                    yield from self._follows(scan, name, position, what)
            name = roles["velocity"].get(joint)
            if name is not None:
                rate = np.gradient(_smooth(position, window), window.step)
                what = f"derivative of {joint}'s position"
                yield from self._follows(scan, name, rate, what, zero=True)
        yield from self._standing(scan, list(joints))
        self._keep_torques(scan, joints, roles["torque"])

    def _standing(self, scan: RecordScan, moved: list[str]) -> Iterator[Finding]:
        """Joints without an angle: where they stand, and whether a load depends on it."""
        robot = self.context.robot
        if robot is None:
            return
        self._rests = set()
        unknown = [joint for joint, at in scan.record.standing(robot).items() if at is None]
        if not unknown:
            return
        self._rests = set(robot.resting_on(unknown))
        needed = [joint for joint in moved if joint in self._rests]
        matters = f"; what {', '.join(needed)} must carry depends on it" if needed else ""
        yield self.found("standing", scan.file, joints=", ".join(unknown), matters=matters,
                         mild=not needed)  # fmt: skip

    def _follows(self, scan: RecordScan, name: str, leader: FloatArray, what: str,
                 zero: bool = False) -> Iterator[Finding]:  # fmt: skip
        values = scan.window.arrays[name]
        a, b = leader - (0.0 if zero else leader.mean()), values - (0.0 if zero else values.mean())
        power, other = float(a @ a), float(b @ b)
        if a.size < _FEWEST or power <= 0.0 or other <= 0.0:
            return
        if min(np.ptp(a), np.ptp(b)) < 100.0 * np.median(np.abs(np.diff(values))) * 0.05:
            return
        if float(np.ptp(leader)) <= 0.02:
            return
        likeness = float(a @ b) / np.sqrt(power * other)
        slope = float(a @ b) / power
        if likeness < -0.7:
            yield self.found("flipped", scan.file, name, likeness, leader=what)
        elif likeness < 0.5:
            yield self.found("unlike", scan.file, name, likeness, leader=what)
        elif not 0.6 < slope < 1.6:
            degrees = " (57.3: degrees?)" if 0.8 < max(slope, 1 / slope) / 57.3 < 1.25 else ""
            yield self.found("factor", scan.file, name, slope, leader=what, degrees=degrees)

    def _keep_torques(
        self, scan: RecordScan, joints: dict[str, FloatArray], torques: dict[str, str]
    ) -> None:
        robot, window = self.context.robot, scan.window
        measured = [joint for joint in joints if joint in torques and joint not in self._rests]
        if robot is None or not measured or any(j not in robot.joint_names for j in joints):
            return
        smooth = {joint: _smooth(values, window) for joint, values in joints.items()}
        m = window.time.size
        edge = round(2.0 * _SMOOTH * window.rate)
        if m < 4 * edge + _FEWEST:
            return
        acceleration = {j: np.gradient(np.gradient(v, window.step), window.step)
                        for j, v in smooth.items()}  # fmt: skip
        index = np.linspace(edge, m - edge - 1, min(_SAMPLES, m - 2 * edge)).astype(int)
        size = len(robot.joint_names)
        pose, fast = np.zeros((index.size, size)), np.zeros((index.size, size))
        for joint, stands in scan.record.standing(robot).items():
            pose[:, robot.joint_names.index(joint)] = stands or 0.0
        for joint in joints:
            at = robot.joint_names.index(joint)
            pose[:, at], fast[:, at] = smooth[joint][index], acceleration[joint][index]
        must = np.array([
            robot.rigid.mass_matrix(q) @ a + robot.rigid.gravity_torque(q)
            for q, a in zip(pose, fast, strict=True)
        ])  # fmt: skip
        for joint in measured:
            velocity = np.gradient(smooth[joint], window.step)[index]
            seen = _smooth(window.arrays[torques[joint]], window)[index]
            basis = np.column_stack([np.ones(index.size), np.tanh(velocity / 0.01), velocity])
            q, _ = np.linalg.qr(basis)
            left = [v - q @ (q.T @ v) for v in (seen, must)]
            number = robot.joint_names.index(joint)
            self.kept[number, torques[joint]].append((left[0], left[1].T))

    def finish(self) -> Iterator[Finding]:
        """Torques against gravity and masses, all records together."""
        robot = self.context.robot
        if robot is None:
            return
        for (own, channel), rows in self.kept.items():
            seen = np.concatenate([row[0] for row in rows])
            must = np.concatenate([row[1] for row in rows], axis=1)
            likeness = cosines(seen, must)
            size = np.linalg.norm(must, axis=1)
            if not size[own] > 0.05 * size.max():
                continue
            best = int(np.abs(likeness).argmax())
            if likeness[own] < -0.6:
                yield self.found("torque-flipped", None, channel, likeness[own])
            elif best != own and abs(likeness[best]) > 0.93 and likeness[own] < 0.4:
                names = robot.joint_names
                yield self.found("torque-swapped", None, channel, likeness[own], other=names[best],
                                 own=names[own])  # fmt: skip
            elif likeness[own] > 0.8:
                slope = float(seen @ must[own] / (must[own] @ must[own]))
                if not 0.125 < slope < 8.0:
                    yield self.found("torque-factor", None, channel, slope)


def _roles(window: Window) -> dict[str, dict[str, str]]:
    """What a channel is in a motion -> joint -> the channel; a "velocity" has a role, too."""
    found: dict[str, dict[str, str]] = defaultdict(dict)
    for name, channel in window.channels.items():
        role = channel.kind.motion
        if channel.kind.of == "joint" and channel.kind.derivative == 1 and not role:
            found["velocity"][channel.subject or ""] = name
        elif role:
            found[role][channel.subject or ""] = name
    return found


def _smooth(values: FloatArray, window: Window) -> FloatArray:
    """(m,) a Gaussian mean over a twentieth of a second, ends held."""
    from scipy.ndimage import gaussian_filter1d

    return np.asarray(gaussian_filter1d(values, max(1.0, 0.5 * _SMOOTH * window.rate),
                                        mode="nearest"))  # fmt: skip
