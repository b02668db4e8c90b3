"""Delays and high-pass filters: the phase of one sensor against another.

In the ring-down every channel is a sum of the same damped waves. Velocity is s times displacement,
acceleration s^2 times it, s the wave's pole; and with a robot all of them follow from the
deflections by the Jacobian. What a wrong model of masses or springs changes is the size, hardly
the phase: a phase that grows with the frequency is a delay, one that falls with it a high-pass.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from picchio.campaign.channels import AXES
from picchio.core.arrays import ComplexArray, FloatArray
from picchio.core.errors import InputError
from picchio.measurement.noise.ringdown import fit_ring_down
from picchio.measurement.noise.window import Window
from picchio.measurement.quality.check import Check, Context, Finding
from picchio.measurement.quality.relabel import relabel
from picchio.measurement.quality.scan import RecordScan

_RECORDS = 8
_POWERS = {"displacement": 0, "velocity": 1, "acceleration": 2}
_Waves = dict[str, ComplexArray]


class PhaseCheck(Check):
    """Phases of the ring-down's waves between the channels of one frame, or the deflections."""

    name = "phase"
    what = "an accelerometer's high-pass, delays between sensors (their phase in the ring-down)"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._looked = 0
        # group: (frequency, phase, weight) of every wave
        self._points: dict[str, list[tuple[float, float, float]]] = defaultdict(list)
        # group: (3,) seen and (3,) expected, one row a wave
        self._vectors: dict[str, list[tuple[ComplexArray, ComplexArray]]] = defaultdict(list)

    def record(self, scan: RecordScan) -> Iterator[Finding]:
        """Collects phases; judged in the end."""
        yield from ()
        window = scan.window
        if self._looked >= _RECORDS or window.steady or window.record.kind == "motion":
            return
        pairs = self._pairs(window)
        after = window.after()
        if not pairs or after.stop - after.start < 200:
            return
        names = sorted({name for waves in pairs for name in waves})
        found = fit_ring_down(np.stack([window.arrays[n][after] for n in names]), window.rate)
        if found is None or not found.poles.size:
            return
        self._looked += 1
        m = found.residual.shape[1]
        waves, error = _amplitudes(window, after, names, found.poles, m)
        self._compare(window, waves, error, found.poles)

    def _pairs(self, window: Window) -> list[list[str]]:
        groups = {window.record.channel(n).group for n in window.arrays}
        deflections = [n for n in window.arrays if n.startswith("deflection.")]
        robot = self.context.robot
        every = [n for g in sorted(groups) if g.partition(".")[0] in (*_POWERS, "accelerometer")
                 for n in window.arrays if window.record.channel(n).group == g]  # fmt: skip
        by_robot = robot is not None and {f"deflection.{j}" for j in robot.flexible_names} <= set(
            deflections
        )
        frames = [g.partition(".")[2] for g in groups if g.partition(".")[0] in _POWERS]
        same = len(frames) > len(set(frames))
        return [every + deflections] if every and (by_robot or same) else []

    def _compare(self, window: Window, waves: _Waves, error: dict[str, FloatArray],
                 poles: ComplexArray) -> None:  # fmt: skip
        must = self._from_deflections(window, waves, poles)
        source = "deflections"
        if must is None:
            must, source = _from_same_frame(window, waves, poles), ""
        self._keep_vectors(waves, error, must)
        for name, expected in must.items():
            group = window.record.channel(name).group
            for k, s in enumerate(poles):
                seen, strength = waves[name][k], abs(waves[name][k])
                if strength < 8.0 * error[name][k] or abs(expected[k]) < 0.1 * strength:
                    continue
                if s.imag < 2.0 * np.pi or abs(expected[k]) > 10.0 * strength:
                    continue
                if -s.real > 0.3 * s.imag:
                    continue
                phase = float(np.angle(seen / expected[k]))
                weight = strength / error[name][k]
                self._points[f"{group}|{source}"].append(
                    (float(s.imag), phase, float(min(weight, 200.0)))
                )

    def _keep_vectors(self, waves: _Waves, error: dict[str, FloatArray], must: _Waves) -> None:
        groups = {name.rpartition(".")[0] for name in must}
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
        names = [f"deflection.{joint}" for joint in robot.flexible_names]
        if not all(name in waves for name in names):
            return None
        x = np.stack([waves[name] for name in names])
        gravity = np.asarray(robot.mounting.gravity, dtype=float)
        found: _Waves = {}
        for group in {window.record.channel(n).group for n in waves}:
            kind, _, frame = group.partition(".")
            if kind not in _POWERS and kind != "accelerometer":
                continue
            try:
                jacobian = robot.frame_jacobian(robot.pose(pose), frame)
                _, rotation = robot.frame_placement(robot.pose(pose), frame)
            except InputError:
                continue
            move, turn = jacobian[:3] @ x, jacobian[3:] @ x
            if kind == "accelerometer":
                move = rotation.T @ (move * poles**2 + np.cross(turn.T, gravity).T)
            else:
                move = move * poles ** _POWERS[kind]
            for axis, row in zip(AXES, move, strict=True):
                if f"{group}.{axis}" in waves:
                    found[f"{group}.{axis}"] = row
        return found

    def finish(self) -> Iterator[Finding]:
        """Axes, and a high-pass and a delay fitted to the phases of every sensor."""
        for group, rows in self._vectors.items():
            ways = relabel([row[0] for row in rows], [row[1] for row in rows])
            if group in self.context.told or len(rows) < 4 or ways.rivals:
                continue
            if ways.as_labelled < 0.6 and ways.best > 0.9:
                self.context.told.add(group)
                yield self.found(
                    "warning",
                    f"its axes seem swapped or flipped: {ways.words}. The ring-down fits the other "
                    f"channels to {100 * ways.best:.0f} %, as labelled to "
                    f"{100 * ways.as_labelled:.0f} %",
                    "check how the sensor is mounted, then relabel the columns",
                    channel=group, value=ways.as_labelled,
                )  # fmt: skip
        for key, points in self._points.items():
            group, _, source = key.partition("|")
            if group in self.context.told:
                continue  # phases of the wrong axes mean nothing
            against = "the deflections" if source else "the other channels of its frame"
            fit = _fit(np.array(points)) if len(points) >= 4 else None
            if fit is None:
                continue
            corner, corner_error, delay, delay_error = fit
            if corner > max(5.0 * corner_error, 0.15):
                yield self.found(
                    "warning",
                    f"leads {against} more at low frequencies, as after a high-pass of "
                    f"{corner:.2g} Hz",
                    "switch the sensor to DC, or add the filter to the model (sensor_highpass)",
                    channel=group, value=corner, unit="Hz",
                )  # fmt: skip
            if abs(delay) > max(5.0 * delay_error, 3e-4):
                word = "later" if delay > 0.0 else "earlier"
                yield self.found(
                    "warning",
                    f"reads {1e3 * abs(delay):.2g} ms {word} than {against}"
                    + (f" (or through a low-pass of {1 / (2 * np.pi * delay):.2g} Hz)"
                       if delay > 0.0 else ""),
                    "are the recorders started by one trigger? shift its time, or add the delay "
                    "to the model (sensor_delay)",
                    channel=group, value=delay, unit="s",
                )  # fmt: skip


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


def _from_same_frame(window: Window, waves: _Waves, poles: ComplexArray) -> _Waves:
    """What velocity and acceleration must be, from the channel with fewest derivatives."""
    found: _Waves = {}
    for name in waves:
        channel = window.record.channel(name)
        if channel.kind.name not in _POWERS:
            continue
        for kind in ("displacement", "velocity"):
            other = f"{kind}.{channel.subject}.{channel.axis}"
            if other in waves and _POWERS[kind] < _POWERS[channel.kind.name]:
                found[name] = waves[other] * poles ** (
                    _POWERS[channel.kind.name] - _POWERS[kind]
                )  # fmt: skip
                break
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
    corner = float(found.x[0]) * 30.0 / (2.0 * np.pi)
    return corner, float(error[0]) * 30.0 / (2.0 * np.pi), float(found.x[1]) * 1e-2, (
        float(error[1]) * 1e-2
    )  # fmt: skip
