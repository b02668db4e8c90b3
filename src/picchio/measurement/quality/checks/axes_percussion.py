"""Swapped or flipped axes, from the first milliseconds of a blow.

From rest, before the springs have had time to answer, the acceleration is M^-1 J^T n F: its
direction at every sensor follows from the robot's masses and the pose. Over the first milliseconds
the springs of the nominal model are taken along; where modes faster than that matter (light
wrists), nothing is claimed.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from picchio.campaign.channels import AXES
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.measurement.noise.window import Window
from picchio.measurement.quality.check import Check, Context, Finding
from picchio.measurement.quality.relabel import relabel
from picchio.measurement.quality.scan import RecordScan
from picchio.robot.flexible_robot import FlexibleRobot

_KINDS = {"accelerometer": 2, "acceleration": 2, "velocity": 1, "displacement": 0, "deflection": 0}
_LOOK = 0.008  # s
_FAST = 60.0  # Hz; slower modes keep their phase within that time, whatever the tolerance
_SHARE = 0.3
_FACTORS = {9.80665: "g written as m/s^2?", 57.29578: "deg written as rad?", 1e3: "mm or mrad?"}


class PercussionAxesCheck(Check):
    """Which way each sensor starts to move, against which way it must."""

    name = "axes"
    what = "axes and joints swapped or flipped: the first milliseconds of a blow"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._frames: dict[str, list[tuple[str, FloatArray, FloatArray]]] = defaultdict(list)
        self._joints: dict[str, list[tuple[str, FloatArray, FloatArray]]] = defaultdict(list)

    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """Keeps what was seen and what must be; judged in the end."""
        yield from ()
        window, robot, record = scan.window, self.context.robot, scan.record
        if robot is None or window.blows is None or window.steady or record.kind == "motion":
            return
        try:
            assert record.pose is not None and record.direction is not None
            start = _Start(robot, robot.pose(record.pose), record.direction)
        except (InputError, np.linalg.LinAlgError):
            return
        width = window.blows.width or 0.1 * window.blows.period
        # A blow's mean is what counts in so short a time.
        force = window.blows.peak_force * window.blows.fullness
        for group in {record.channel(n).group for n in window.arrays if record.channel(n).axis}:
            names = [f"{group}.{axis}" for axis in AXES]
            kind, _, frame = group.partition(".")
            if kind in _KINDS and all(name in window.arrays for name in names):
                inside, time = _first(window, kind, width)
                must = start.of_frame(frame, kind, time, width, force)
                seen = np.stack([window.arrays[n][inside] - _zero(window, n) for n in names])
                if must is not None and self._stands_out(names, seen):
                    self._frames[group].append((scan.file, seen, must))
        for name in window.arrays:
            channel = record.channel(name)
            if channel.kind.name == "deflection" and channel.subject in robot.flexible_names:
                inside, time = _first(window, "deflection", width)
                every, clear = start.of_joints(time, width, force)
                own = robot.flexible_names.index(str(channel.subject))
                seen = window.arrays[name][inside] - _zero(window, name)
                if clear[own] and self._stands_out([name], seen[None]):
                    self._joints[str(channel.subject)].append((scan.file, seen, every))

    def _stands_out(self, names: list[str], seen: FloatArray) -> bool:
        spread = max(self.context.std(name) + self.context.hum(name) for name in names)
        return seen.shape[1] >= 2 and float((seen**2).mean()) > 9.0 * spread**2

    def finish(self) -> Iterator[Finding]:
        """One verdict for every sensor."""
        for group, rows in self._frames.items():
            yield from self._judge_frame(group, rows)
        yield from self._judge_joints()

    def _judge_frame(
        self, group: str, rows: list[tuple[str, FloatArray, FloatArray]]
    ) -> Iterator[Finding]:
        fit = relabel([row[1] for row in rows], [row[2] for row in rows])
        ratio = float(np.median([np.linalg.norm(seen) / np.linalg.norm(must)
                                 for _, seen, must in rows]))  # fmt: skip
        if fit.as_labelled < 0.85 and fit.best > 0.93 and fit.best - fit.as_labelled > 0.1:
            self.context.told.add(group)
            others = f" (or {fit.rivals} other ways: these directions cannot tell them apart)"
            yield self.found(
                "warning",
                f"its axes seem swapped or flipped: {fit.words}{others if fit.rivals else ''}. The "
                f"first milliseconds agree to {100 * fit.best:.0f} % with the expected direction, "
                f"as labelled to {100 * fit.as_labelled:.0f} %",
                "check how the sensor is mounted, then relabel the columns",
                channel=group, value=fit.as_labelled,
            )  # fmt: skip
        elif fit.as_labelled < 0.7:
            yield self.found(
                "warning",
                "starts to move in another direction than the robot's masses allow (cosine "
                f"{fit.as_labelled:.2f} over {len(rows)} records)",
                "check the sensor's mounting, the poses and the force's directions",
                channel=group, value=fit.as_labelled,
            )  # fmt: skip
        if not 1.0 / 2.5 < ratio < 2.5:
            close = [text for f, text in _FACTORS.items()
                     if min(abs(np.log(ratio / f)), abs(np.log(ratio * f))) < 0.35]  # fmt: skip
            yield self.found("warning", f"starts {ratio:.3g} times as strongly as the robot's "
                             "masses allow", "check the unit: " + close[0] if close else
                             "check the unit, the sensitivity, and the force",
                             channel=group, value=ratio)  # fmt: skip

    def _judge_joints(self) -> Iterator[Finding]:
        robot = self.context.robot
        if robot is None:
            return
        names = robot.flexible_names
        for joint, rows in self._joints.items():
            own = names.index(joint)
            scale = [float(np.linalg.norm(every)) for _, _, every in rows]
            seen = np.concatenate([row[1] / k for row, k in zip(rows, scale, strict=True)])
            must = np.concatenate([row[2] / k for row, k in zip(rows, scale, strict=True)], axis=1)
            likeness = must @ seen / (
                np.linalg.norm(seen) * np.maximum(np.linalg.norm(must, axis=1), 1e-12))  # fmt: skip
            best = int(np.abs(likeness).argmax())
            if best == own and likeness[own] < -0.8:
                yield self.found("warning", "starts the wrong way: its sign is flipped",
                                 "deflection is link side minus motor side",
                                 channel=f"deflection.{joint}",
                                 value=float(likeness[own]))  # fmt: skip
            elif (
                best != own
                and len(rows) >= 4
                and abs(likeness[best]) > 0.95
                and (likeness[own] < 0.6)
            ):
                sign = "minus " if likeness[best] < 0.0 else ""
                yield self.found("warning", f"moves like {sign}{names[best]}: joints are swapped",
                                 "relabel the columns", channel=f"deflection.{joint}",
                                 value=float(likeness[own]))  # fmt: skip
            size = float(seen @ must[own] / max(float(must[own] @ must[own]), 1e-12))
            if likeness[own] > 0.9 and not 1 / 3.0 < size < 3.0:
                close = [text for f, text in _FACTORS.items()
                         if min(abs(np.log(size / f)), abs(np.log(size * f))) < 0.35]  # fmt: skip
                yield self.found("warning", f"starts {size:.3g} times as strongly as the robot's "
                                 "masses allow", "check the unit" +
                                 (": " + close[0] if close else ""),
                                 channel=f"deflection.{joint}", value=size)  # fmt: skip


class _Start:
    """How the robot starts to move under a constant force, by its slow modes."""

    def __init__(self, robot: FlexibleRobot, pose: FloatArray, direction: FloatArray) -> None:
        from scipy.linalg import eigh

        self.robot, self.pose = robot, pose
        state = robot.state(pose)
        squared, self.shapes = eigh(np.diag(state.stiffness), state.mass_matrix)
        self.omega = np.sqrt(np.maximum(squared, 1e-12))
        self.push = self.shapes.T @ (state.jacobian.T @ direction)
        self.slow = self.omega < 2.0 * np.pi * _FAST

    def _modes(self, order: int, time: FloatArray, width: float, force: float) -> FloatArray:
        """(n, m) each mode's displacement, velocity or acceleration; fast ones: their size."""
        w = self.omega[:, None]
        late = np.clip(time - width, 0.0, None)
        shape = (
            (np.cos(w * late) - np.cos(w * time)) / w**2,
            (np.sin(w * time) - np.sin(w * late)) / w,
            np.cos(w * time) - np.where(time > width, np.cos(w * late), 0.0),
        )[order]
        bound = np.broadcast_to(2.0 / w ** (2 - order), shape.shape)
        return force * self.push[:, None] * np.where(self.slow[:, None], shape, bound)

    def of_frame(self, frame: str, kind: str, time: FloatArray, width: float,
                 force: float) -> FloatArray | None:  # fmt: skip
        """(3, m) in the sensor's axes; None where fast modes would matter, or without frame."""
        try:
            jacobian = self.robot.frame_jacobian(self.pose, frame)[:3]
            _, rotation = self.robot.frame_placement(self.pose, frame)
        except InputError:
            return None
        shapes = jacobian @ self.shapes
        modes = self._modes(_KINDS[kind], time, width, force)
        slow = shapes[:, self.slow] @ modes[self.slow]
        fast = np.abs(shapes[:, ~self.slow]) @ np.abs(modes[~self.slow])
        if not np.linalg.norm(fast) < _SHARE * np.linalg.norm(slow):
            return None
        return np.asarray(rotation.T @ slow if kind == "accelerometer" else slow)

    def of_joints(self, time: FloatArray, width: float,
                  force: float) -> tuple[FloatArray, FloatArray]:  # fmt: skip
        """(n, m) deflections, and (n,) where no fast mode matters."""
        modes = self._modes(0, time, width, force)
        slow = self.shapes[:, self.slow] @ modes[self.slow]
        fast = np.abs(self.shapes[:, ~self.slow]) @ np.abs(modes[~self.slow])
        clear = np.linalg.norm(fast, axis=1) < _SHARE * np.linalg.norm(slow, axis=1)
        return slow, clear


def _first(window: Window, kind: str, width: float) -> tuple[FloatArray, FloatArray]:
    """Which samples are used, and their times; accelerations while the force is on."""
    until = min(0.95 * width, _LOOK) if _KINDS[kind] == 2 else _LOOK
    inside = (window.time > 0.02 * width) & (window.time < until)
    return inside, window.time[inside]


def _zero(window: Window, name: str) -> float:
    quiet = window.quiet()
    return float(window.arrays[name][quiet].mean()) if quiet.stop >= 8 else 0.0
