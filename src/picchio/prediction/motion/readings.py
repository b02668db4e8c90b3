"""What drives and encoders should have read: the nominal robot's, or one with effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.model.effects import Effect
from picchio.model.motion import RIPPLE, ROTOR, TORQUE, WINDUP
from picchio.prediction.motion.filters import Band
from picchio.prediction.motion.log import MotionLog
from picchio.prediction.motion.rigid import rigid_motion
from picchio.robot import FlexibleRobot

_TAPS = 8
Parts = list[tuple[str, str, FloatArray]]


@dataclass(frozen=True, eq=False)
class Readings:
    """What channels should read in one record, at all its samples.

    Attributes:
        torque: joint -> N m or N, in the band.
        ripple: joint -> N m or N, above the band.
        windup: joint -> rad or m, link side less motor side, without its constant offset.
    """

    torque: dict[str, FloatArray]
    ripple: dict[str, FloatArray]
    windup: dict[str, FloatArray]


class Predictor:
    """Predicts one record again and again while effects change; terms are kept.

    Args:
        robot: the nominal robot.
        log: the record.
        band: in which torques are compared.
    """

    def __init__(self, robot: FlexibleRobot, log: MotionLog, band: Band) -> None:
        self.log, self.band = log, band
        self.nominal = rigid_motion(robot, log, band)
        self._moving = frozenset(log.moving)
        self._parts: dict[object, tuple[Parts, dict[str, float], dict[str, float]]] = {}

    def body(self, effects: Sequence[Effect]) -> dict[str, FloatArray]:
        """Joint -> torque that the bodies take, with the effects that add masses, N m."""
        motion = replace(self.nominal, body=dict(self.nominal.body), added=[], gains={}, delays={})
        for effect in effects:
            if self.concerns(effect):
                effect.motion(motion)
        return motion.body

    def concerns(self, effect: Effect) -> bool:
        """Whether the effect can show in this record: a joint that stands tells nothing."""
        return effect.target_kind != "joint" or effect.target in self._moving

    def predict(
        self,
        effects: Sequence[Effect],
        scales: Mapping[str, float] | None = None,
        joint: str | None = None,
    ) -> Readings:
        """Readings with these effects.

        Args:
            effects: in any order.
            scales: joint -> factor on the nominal rigid-body torque; 1 where left out.
            joint: only this one's readings are asked for.
        """
        heavy = [e for e in effects if self._is_body(e)]
        body = self.body(heavy) if heavy else self.nominal.body
        key = tuple(e.key for e in heavy)
        torque = {}
        for name, nominal in self.nominal.body.items():
            if joint in (None, name):
                factor = 1.0 if scales is None else scales.get(name, 1.0)
                torque[name] = body[name] + (factor - 1.0) * nominal
        ripple = {name: np.zeros(self.log.samples) for name in torque}
        windup = {name: np.zeros(self.log.samples) for name in self.log.link if name in torque}
        gains: dict[str, float] = {}
        delays: dict[str, float] = {}
        for effect in effects:
            if not self.concerns(effect) or (
                joint is not None and effect.target_kind == "joint" and effect.target != joint
            ):
                continue
            parts, own_gains, own_delays = self._of(effect, body, key)
            for kind, name, values in parts:
                target = {TORQUE: torque, RIPPLE: ripple, WINDUP: windup}[kind]
                if name in target:
                    target[name] = target[name] + values
            for name, gain in own_gains.items():
                gains[name] = gains.get(name, 1.0) * gain
            for group, delay in own_delays.items():
                delays[group] = delays.get(group, 0.0) + delay
        for name, gain in gains.items():
            if name in torque:
                torque[name], ripple[name] = gain * torque[name], gain * ripple[name]
        self._delay(torque, ripple, windup, delays)
        return Readings(torque, ripple, windup)

    def _delay(self, torque: dict[str, FloatArray], ripple: dict[str, FloatArray],
               windup: dict[str, FloatArray], delays: Mapping[str, float]) -> None:  # fmt: skip
        """Times at which things were stamped.

        Torques are predicted from measured angles: where those are late, the measured torque is
        early against its prediction.
        """
        if not delays:
            return
        for joint in torque:
            late = delays.get(TORQUE, 0.0) - delays.get(self.log.group[joint], 0.0)
            if late:
                torque[joint] = shift(torque[joint], late * self.log.rate)
                ripple[joint] = shift(ripple[joint], late * self.log.rate)
        for joint in windup:
            late = delays.get("position", 0.0) - delays.get("motor_position", 0.0)
            if late:
                motor = self.log.angle[joint]
                windup[joint] = windup[joint] + shift_smooth(motor, late * self.log.rate) - motor

    def _is_body(self, effect: Effect) -> bool:
        """Whether the effect changes what other effects see: the load of the gears."""
        if not self.concerns(effect):
            return False
        known = self._parts.get(("is body", type(effect)))
        if known is None:
            motion = replace(self.nominal, body=dict(self.nominal.body), added=[], gains={},
                             delays={})  # fmt: skip
            effect.motion(motion)
            changed = any(motion.body[j] is not x for j, x in self.nominal.body.items())
            known = ([], {"body": float(changed)}, {})
            neutral = all(effect.values[p.name] == p.neutral for p in effect.parameters)
            if not neutral:
                self._parts["is body", type(effect)] = known
        return bool(known[1]["body"])

    def _of(self, effect: Effect, body: dict[str, FloatArray], key: object) -> tuple[
            Parts, dict[str, float], dict[str, float]]:  # fmt: skip
        """What an effect adds: filtered where it jumps."""
        name = (effect.key, key)
        if name not in self._parts:
            if len(self._parts) > 600:
                self._parts.clear()
            motion = replace(self.nominal, body=dict(body), added=[], gains={}, delays={})
            effect.motion(motion)
            parts: Parts = []
            for kind, joint, values in motion.added:
                if kind == ROTOR:
                    parts.append((TORQUE, joint, values))
                elif kind == TORQUE:
                    parts.append((TORQUE, joint, self.band.low_pass(values)))
                elif kind == RIPPLE:
                    slow = self.band.low_pass(values)
                    parts += [(TORQUE, joint, slow), (RIPPLE, joint, values - slow)]
                else:
                    parts.append((kind, joint, values))
            self._parts[name] = (parts, motion.gains, motion.delays)
        return self._parts[name]


def shift(series: FloatArray, late: float) -> FloatArray:
    """The series, later by `late` samples, by a windowed sinc; its ends are continued straight."""
    whole = int(np.floor(late))
    taps = np.arange(1 - _TAPS, _TAPS + 1)
    distance = taps - (late - whole)
    kernel = np.sinc(distance) * np.cos(0.5 * np.pi * distance / (_TAPS + 1)) ** 2
    kernel /= kernel.sum()
    pad = _TAPS + abs(whole)
    ramp = np.arange(1, pad + 1)
    start = series[0] - (series[1] - series[0]) * ramp[::-1]
    end = series[-1] + (series[-1] - series[-2]) * ramp
    padded = np.concatenate([start, series, end])
    # out[i] = sum_k kernel[k] series[i - whole - taps[k]]
    full = np.convolve(padded, kernel)
    first = pad + _TAPS - 1 - whole
    found: FloatArray = full[first : first + series.size]
    return found


def shift_smooth(series: FloatArray, late: float) -> FloatArray:
    """The same for a smooth series whose small changes count: a cubic spline."""
    from scipy.interpolate import CubicSpline

    t = np.arange(series.size, dtype=np.float64)
    found: FloatArray = CubicSpline(t, series)(np.clip(t - late, 0.0, t[-1]))
    return found
