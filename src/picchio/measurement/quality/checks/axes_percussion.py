"""Swapped or flipped axes, from the first milliseconds of a blow.

From rest, before the springs have had time to answer, the acceleration is M^-1 J^T n F: its
direction at every sensor follows from the robot's masses and the pose. Over the first milliseconds
the springs of the nominal model are taken along; where modes faster than that matter (light
wrists), nothing is claimed.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator

import numpy as np

from picchio.campaign.channels import AXES, Channel
from picchio.core.arrays import BoolArray, FloatArray
from picchio.core.errors import InputError
from picchio.excitation.excitation import Excitation
from picchio.measurement.noise.window import Window
from picchio.measurement.quality.check import Check, Context, Finding
from picchio.measurement.quality.relabel import cosines, relabel
from picchio.measurement.quality.scan import RecordScan
from picchio.model.linear_system import undamped_modes
from picchio.robot.flexible_robot import FlexibleRobot

_LOOK = 0.008  # s
_FAST = 60.0  # Hz; slower modes keep their phase within that time, whatever the tolerance
_SHARE = 0.3
Pair = tuple[FloatArray, FloatArray]
_FACTORS = {9.80665: "g written as m/s^2?", 57.29578: "deg written as rad?", 1e3: "mm or mrad?"}


class PercussionAxesCheck(Check):
    """Which way each sensor starts to move, against which way it must."""

    name = "axes"
    of = "percussion"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        # What was seen and what must be, a record each; of a joint's channel, with the joint's
        # number, what all joints must show.
        self._frames: dict[str, list[Pair]] = defaultdict(list)
        self._joints: dict[tuple[str, int], list[Pair]] = defaultdict(list)

    def record(self, scan: RecordScan) -> Iterable[Finding]:
        """Keeps what was seen and what must be; judged in the end."""
        window, robot, record = scan.window, self.context.robot, scan.record
        if robot is None or window.blows is None or window.steady:
            return ()
        try:
            assert record.pose is not None and record.direction is not None
            pose = robot.pose(record.pose)
            start = _Start(robot, pose, record.direction, window.blows)
        except InputError:
            return ()
        for group, channels in window.groups.items():
            kind = channels[0].kind
            if not kind.answers or kind.derivative is None:
                continue
            inside = start.first(window.time, kind.derivative)
            time = window.time[inside]
            if kind.axes and len(channels) == len(AXES):
                names = [f"{group}.{axis}" for axis in AXES]
                frame_must = start.of_frame(channels[0], time)
                seen = np.stack([window.arrays[n][inside] - _zero(window, n) for n in names])
                if frame_must is not None and self._stands_out(names, seen):
                    self._frames[group].append((seen, frame_must))
            for channel in channels:
                if kind.of != "joint" or channel.subject not in robot.flexible_names:
                    continue
                every, clear = start.of_joints(kind.derivative, time)
                own = robot.flexible_names.index(str(channel.subject))
                values = window.arrays[channel.name][inside] - _zero(window, channel.name)
                if clear[own] and self._stands_out([channel.name], values[None]):
                    self._joints[channel.name, own].append((values, every))
        return ()

    def _stands_out(self, names: list[str], seen: FloatArray) -> bool:
        spread = max(self.context.std(name) + self.context.hum(name) for name in names)
        return seen.shape[1] >= 2 and float((seen**2).mean()) > 9.0 * spread**2

    def finish(self) -> Iterator[Finding]:
        """One verdict for every sensor."""
        for group, rows in self._frames.items():
            yield from self._judge_frame(group, rows)
        for (name, own), rows in self._joints.items():
            yield from self._judge_joint(name, own, rows)

    def _judge_frame(self, group: str, rows: list[Pair]) -> Iterator[Finding]:
        fit = relabel([seen for seen, _ in rows], [must for _, must in rows])
        ratio = float(np.median([np.linalg.norm(seen) / np.linalg.norm(must)
                                 for seen, must in rows]))  # fmt: skip
        if fit.as_labelled < 0.85 and fit.best > 0.93 and fit.best - fit.as_labelled > 0.1:
            self.context.told.add(group)
            others = f" (or {fit.rivals} other ways: these directions cannot tell them apart)"
            yield self.found(
                "relabel", None, group, fit.as_labelled, words=fit.words,
                others=others if fit.rivals else "", best=100 * fit.best,
                labelled=100 * fit.as_labelled,
            )  # fmt: skip
        elif fit.as_labelled < 0.7:
            yield self.found("direction", None, group, fit.as_labelled, records=len(rows))
        yield from self._judge_size(group, ratio, 2.5)

    def _judge_size(self, channel: str, ratio: float, most: float) -> Iterator[Finding]:
        if 1.0 / most < ratio < most:
            return
        close = [w for f, w in _FACTORS.items() if abs(abs(np.log(ratio)) - np.log(f)) < 0.35]
        guess = f": {close[0]}" if close else ", the sensitivity, and the force"
        yield self.found("size", None, channel, ratio, guess=f"check the unit{guess}")

    def _judge_joint(self, channel: str, own: int, rows: list[Pair]) -> Iterator[Finding]:
        assert self.context.robot is not None
        names = self.context.robot.flexible_names
        scale = [float(np.linalg.norm(every)) for _, every in rows]
        seen = np.concatenate([row[0] / k for row, k in zip(rows, scale, strict=True)])
        must = np.concatenate([row[1] / k for row, k in zip(rows, scale, strict=True)], axis=1)
        likeness = cosines(seen, must)
        best = int(np.abs(likeness).argmax())
        if best == own and likeness[own] < -0.8:
            yield self.found("flipped", None, channel, likeness[own])
        elif best != own and len(rows) >= 4 and abs(likeness[best]) > 0.95 and likeness[own] < 0.6:
            sign = "minus " if likeness[best] < 0.0 else ""
            yield self.found("swapped", None, channel, likeness[own], other=sign + names[best])
        if likeness[own] > 0.9:
            size = float(seen @ must[own] / max(float(must[own] @ must[own]), 1e-12))
            yield from self._judge_size(channel, size, 3.0)


class _Start:
    """How the robot starts to move under a constant force, by its slow modes."""

    def __init__(
        self, robot: FlexibleRobot, pose: FloatArray, direction: FloatArray, blows: Excitation
    ) -> None:
        self.robot, self.pose = robot, pose
        self.width = blows.width or 0.1 * blows.period
        # A blow's mean is what counts in so short a time.
        self.force = blows.peak_force * blows.fullness
        state = robot.state(pose)
        self.omega, self.shapes = undamped_modes(state.mass_matrix, np.diag(state.stiffness))
        self.push = self.shapes.T @ (state.jacobian.T @ direction)
        self.slow = self.omega < 2.0 * np.pi * _FAST

    def first(self, time: FloatArray, order: int) -> BoolArray:
        """Which samples are used; of accelerations, while the force is on."""
        until = min(0.95 * self.width, _LOOK) if order == 2 else _LOOK
        return np.asarray((time > 0.02 * self.width) & (time < until))

    def _modes(self, order: int, time: FloatArray) -> FloatArray:
        """(n, m) each mode's displacement, velocity or acceleration; fast ones: their size."""
        w = self.omega[:, None]
        late = np.clip(time - self.width, 0.0, None)
        shape = (
            (np.cos(w * late) - np.cos(w * time)) / w**2,
            (np.sin(w * time) - np.sin(w * late)) / w,
            np.cos(w * time) - np.where(time > self.width, np.cos(w * late), 0.0),
        )[order]
        bound = np.broadcast_to(2.0 / w ** (2 - order), shape.shape)
        return self.force * self.push[:, None] * np.where(self.slow[:, None], shape, bound)

    def of_frame(self, sensor: Channel, time: FloatArray) -> FloatArray | None:
        """(3, m) in the sensor's axes; None where fast modes would matter, or without frame."""
        kind, frame = sensor.kind, sensor.subject or ""
        try:
            jacobian = self.robot.frame_jacobian(self.pose, frame)[:3]
            _, rotation = self.robot.frame_placement(self.pose, frame)
        except InputError:
            return None
        shapes = jacobian @ self.shapes
        slow, fast = self._parts(shapes, kind.derivative or 0, time)
        if not np.linalg.norm(fast) < _SHARE * np.linalg.norm(slow):
            return None
        return np.asarray(rotation.T @ slow if kind.own_axes else slow)

    def of_joints(self, order: int, time: FloatArray) -> tuple[FloatArray, BoolArray]:
        """(n, m) of all joints, and (n,) where no fast mode matters."""
        slow, fast = self._parts(self.shapes, order, time)
        clear = np.linalg.norm(fast, axis=1) < _SHARE * np.linalg.norm(slow, axis=1)
        return slow, clear

    def _parts(self, shapes: FloatArray, order: int, time: FloatArray) -> Pair:
        """What the slow modes do, and at most the fast ones, by their shapes (k, n)."""
        modes = self._modes(order, time)
        slow = shapes[:, self.slow] @ modes[self.slow]
        return slow, np.abs(shapes[:, ~self.slow]) @ np.abs(modes[~self.slow])


def _zero(window: Window, name: str) -> float:
    quiet = window.quiet()
    return float(window.arrays[name][quiet].mean()) if quiet.stop >= 8 else 0.0
