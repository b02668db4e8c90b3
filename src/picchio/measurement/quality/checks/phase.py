"""Delays and high-pass filters: the phase of one sensor against another.

In the ring-down every channel is a sum of the same damped waves. Velocity is s times displacement,
acceleration s^2 times it, s the wave's pole; and with a robot all of them follow from the
deflections by the Jacobian. What a wrong model of masses or springs changes is the size, hardly
the phase: a phase that grows with the frequency is a delay, one that falls with it a high-pass.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator

import numpy as np

from picchio.campaign.channels import AXES, ChannelKind
from picchio.core.arrays import ComplexArray, FloatArray
from picchio.core.errors import InputError
from picchio.measurement.noise.ringdown import fit_ring_down
from picchio.measurement.noise.window import Window
from picchio.measurement.quality.check import Check, Context, Finding
from picchio.measurement.quality.relabel import relabel
from picchio.measurement.quality.scan import RecordScan

_RECORDS = 8
_Waves = dict[str, ComplexArray]


class PhaseCheck(Check):
    """Phases of the ring-down's waves between the channels of one frame, or the deflections."""

    name = "phase"
    of = "percussion"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._looked = 0
        # (group, against the deflections): (frequency, phase, weight) of every wave
        self._points: dict[tuple[str, bool], list[tuple[float, float, float]]] = defaultdict(list)
        # group: (3,) seen and (3,) expected, one row a wave
        self._vectors: dict[str, list[tuple[ComplexArray, ComplexArray]]] = defaultdict(list)

    def record(self, scan: RecordScan) -> Iterable[Finding]:
        """Collects phases; judged in the end."""
        window = scan.window
        if self._looked >= _RECORDS or window.steady:
            return ()
        names = self._comparable(window)
        after = window.after()
        if not names or after.stop - after.start < 200:
            return ()
        found = fit_ring_down(np.stack([window.arrays[n][after] for n in names]), window.rate)
        if found is None or not found.poles.size:
            return ()
        self._looked += 1
        m = found.residual.shape[1]
        waves, error = _amplitudes(window, after, names, found.poles, m)
        self._compare(window, waves, error, found.poles)
        return ()

    def _comparable(self, window: Window) -> list[str]:
        """Channels whose waves follow from one another; none where there are none."""
        channels = window.channels.values()
        deflections = _deflections(window)
        every = [channel for channel in channels if _is_of_frame(channel.kind)]
        robot = self.context.robot
        by_robot = robot is not None and set(robot.flexible_names) <= set(deflections)
        frames = [own[0].subject for own in window.groups.values()
                  if _is_of_frame(own[0].kind) and not own[0].kind.own_axes]  # fmt: skip
        if not every or not (by_robot or len(frames) > len(set(frames))):
            return []
        return sorted({*(channel.name for channel in every), *deflections.values()})

    def _compare(self, window: Window, waves: _Waves, error: dict[str, FloatArray],
                 poles: ComplexArray) -> None:  # fmt: skip
        must = self._from_deflections(window, waves, poles)
        by_robot = must is not None
        if must is None:
            must = _from_same_frame(window, waves, poles)
        self._keep_vectors(waves, error, must)
        for name, expected in must.items():
            group = window.channels[name].group
            for k, s in enumerate(poles):
                seen, strength = waves[name][k], abs(waves[name][k])
                weight = strength / error[name][k]
                alike = 0.1 * strength <= abs(expected[k]) <= 10.0 * strength
                if weight < 8.0 or not alike or -s.real > 0.3 * s.imag or s.imag < 2.0 * np.pi:
                    continue
                phase = np.angle(seen / expected[k])
                self._points[group, by_robot].append((s.imag, phase, min(weight, 200.0)))

    def _keep_vectors(self, waves: _Waves, error: dict[str, FloatArray], must: _Waves) -> None:
        groups = dict.fromkeys(name.rpartition(".")[0] for name in must)
        for group in groups:
            names = [f"{group}.{axis}" for axis in AXES]
            if not all(name in must for name in names):
                continue
            seen = np.stack([waves[name] for name in names])
            expected = np.stack([must[name] for name in names])
            noise = np.stack([error[name] for name in names])
            for k in range(seen.shape[1]):
                if np.linalg.norm(seen[:, k]) > 10.0 * np.linalg.norm(noise[:, k]):
                    self._vectors[group].append((seen[:, k], expected[:, k]))

    def _from_deflections(self, window: Window, waves: _Waves,
                          poles: ComplexArray) -> _Waves | None:  # fmt: skip
        robot, pose = self.context.robot, window.record.pose
        if robot is None or pose is None:
            return None
        deflections = _deflections(window)
        if not set(robot.flexible_names) <= set(deflections):
            return None
        x = np.stack([waves[deflections[joint]] for joint in robot.flexible_names])
        gravity = np.asarray(robot.mounting.gravity, dtype=float)
        found: _Waves = {}
        for channels in window.groups.values():
            kind, frame = channels[0].kind, channels[0].subject or ""
            if not _is_of_frame(kind):
                continue
            try:
                jacobian = robot.frame_jacobian(robot.pose(pose), frame)
                _, rotation = robot.frame_placement(robot.pose(pose), frame)
            except InputError:
                continue
            move, turn = jacobian[:3] @ x, jacobian[3:] @ x
            move = move * poles ** (kind.derivative or 0)
            if kind.own_axes:
                if kind.derivative == 2:
                    move = move + np.cross(turn.T, gravity).T
                move = rotation.T @ move
            found |= {channel.name: move[AXES.index(channel.axis or "x")] for channel in channels}
        return found

    def finish(self) -> Iterator[Finding]:
        """Axes, and a high-pass and a delay fitted to the phases of every sensor."""
        for group, rows in self._vectors.items():
            ways = relabel([row[0] for row in rows], [row[1] for row in rows])
            if group in self.context.told or len(rows) < 4 or ways.rivals:
                continue
            if ways.as_labelled < 0.6 and ways.best > 0.9:
                self.context.told.add(group)
                yield self.found("relabel", None, group, ways.as_labelled, words=ways.words,
                                 best=100 * ways.best, labelled=100 * ways.as_labelled)  # fmt: skip
        for (group, by_robot), points in self._points.items():
            if group in self.context.told:
                continue  # phases of the wrong axes mean nothing
            against = "the deflections" if by_robot else "the other channels of its frame"
            fit = _fit(np.array(points)) if len(points) >= 4 else None
            if fit is None:
                continue
            corner, corner_error, delay, delay_error = fit
            if corner > max(5.0 * corner_error, 0.15):
                yield self.found("highpass", None, group, corner, against=against)
            if abs(delay) > max(5.0 * delay_error, 3e-4):
                yield self.found("later" if delay > 0.0 else "earlier", None, group, delay,
                                 late=1e3 * delay, early=-1e3 * delay, against=against,
                                 corner=1 / (2 * np.pi * delay))  # fmt: skip


def _amplitudes(window: Window, after: slice, names: list[str], poles: ComplexArray,
                samples: int) -> tuple[_Waves, dict[str, FloatArray]]:  # fmt: skip
    """Complex amplitudes of the waves in every channel, and their standard errors."""
    time = np.arange(samples) / window.rate
    wave = np.exp(np.outer(time, poles))
    basis = np.column_stack([np.ones(samples), wave.real, -wave.imag])
    inverse = np.linalg.pinv(basis)
    spread = np.sqrt((inverse**2).sum(axis=1))
    k = poles.size
    waves, error = {}, {}
    for name in names:
        values = window.arrays[name][after][:samples]
        fit = inverse @ values
        left = float(np.std(values - basis @ fit))
        waves[name] = fit[1 : 1 + k] + 1j * fit[1 + k :]
        error[name] = left * np.hypot(spread[1 : 1 + k], spread[1 + k :]) + 1e-300
    return waves, error


def _is_of_frame(kind: ChannelKind) -> bool:
    """Whether its waves follow from the motion of a frame."""
    return kind.of == "frame" and kind.axes and kind.answers and kind.derivative is not None


def _deflections(window: Window) -> dict[str, str]:
    """Joint -> the channel of its deflection."""
    return {
        channel.subject or "": name for name, channel in window.channels.items()
        if channel.kind.of == "joint" and channel.kind.answers and channel.kind.derivative == 0
    }  # fmt: skip


def _from_same_frame(window: Window, waves: _Waves, poles: ComplexArray) -> _Waves:
    """What velocity and acceleration must be, from the channel with fewest derivatives."""
    orders: dict[str, int] = {}
    fewest: dict[tuple[str | None, str | None], str] = {}
    for name in waves:
        channel = window.channels[name]
        place = channel.subject, channel.axis
        if _is_of_frame(channel.kind) and not channel.kind.own_axes:
            orders[name] = channel.kind.derivative or 0
            if place not in fewest or orders[name] < orders[fewest[place]]:
                fewest[place] = name
    found: _Waves = {}
    for name, order in orders.items():
        channel = window.channels[name]
        other = fewest[channel.subject, channel.axis]
        if order > orders[other]:
            found[name] = waves[other] * poles ** (order - orders[other])
    return found


def _fit(points: FloatArray) -> tuple[float, float, float, float] | None:
    """(corner Hz, its error, delay s, its error) from (rad/s, rad, weight) rows, robustly."""
    from scipy.optimize import least_squares

    omega, phase, weight = points.T
    # Half a turn is a flipped axis, which another check reports.
    phase = np.mod(phase + 0.5 * np.pi, np.pi) - 0.5 * np.pi

    def miss(p: FloatArray) -> FloatArray:
        off = np.arctan2(p[0], omega / 30.0) - omega * p[1] * 1e-2 - phase
        return np.asarray((np.mod(off + 0.5 * np.pi, np.pi) - 0.5 * np.pi) * np.sqrt(weight))

    scale = 0.05 * float(np.sqrt(np.median(weight)))
    found = least_squares(miss, np.zeros(2), loss="soft_l1", f_scale=scale)
    left = np.abs(miss(found.x)) / np.sqrt(weight)
    spread = 1.4826 * float(np.median(left)) + 0.003
    jacobian = found.jac
    normal = jacobian.T @ jacobian
    if np.linalg.cond(normal) > 1e8:
        return None
    # Points of one record and mode hang together: count a third of them.
    error = spread * np.sqrt(3.0 * np.median(weight) * np.diag(np.linalg.inv(normal)))
    if spread > 0.15:
        return None
    corner, delay = np.column_stack([found.x, error]) * [[30.0 / (2.0 * np.pi)], [1e-2]]
    return float(corner[0]), float(corner[1]), float(delay[0]), float(delay[1])
