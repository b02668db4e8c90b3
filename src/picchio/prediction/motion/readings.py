"""What drives and encoders should have read: the nominal robot's, or one with effects."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.model.effects.effect import Effect
from picchio.model.inertia import in_frame
from picchio.model.motion import RIPPLE, ROTOR, TORQUE, WINDUP, Motion
from picchio.prediction.motion.filters import Band, shift, shift_smooth
from picchio.prediction.motion.log import MotionLog
from picchio.robot.dynamics.rigid_model import unit_inertia
from picchio.robot.dynamics.statics import balancing
from picchio.robot.flexible_robot import FlexibleRobot

_KEPT = 400
_STILL = 0.01  # of the fastest
_ROUNDED = 1e-9
Part = tuple[str, str, FloatArray]
Parts = list[Part]

Readings = dict[str, dict[str, FloatArray]]
"""What should be read in one record, at all its samples: kind -> joint -> (m,).

The kinds are TORQUE, in the band, and RIPPLE, above it (N m or N), and WINDUP, link side less motor
side without its constant offset (rad or m).
"""


@dataclass(frozen=True, eq=False)
class Around:
    """What all effects together do to each one's own term.

    Attributes:
        body: joint -> torque that the bodies take, N m.
        key: what the body torque follows from.
        gains: joint -> factor on what its drive reports.
        delays: channel group -> s.
        loaded: whether any effect's own term depends on what the bodies take.
    """

    body: Mapping[str, FloatArray]
    key: Hashable
    gains: Mapping[str, float]
    delays: Mapping[str, float]
    loaded: bool


@dataclass(frozen=True, eq=False)
class _Term:
    """What one effect adds: (kind, joint, values), filtered where it jumps; gains; delays."""

    parts: Parts
    gains: Mapping[str, float]
    delays: Mapping[str, float]


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
        self._terms: dict[Hashable, _Term] = {}
        self._heavy: dict[type[Effect], bool] = {}
        self._rests: dict[type[Effect], bool] = {}
        self._alone: tuple[Effect, Mapping[str, FloatArray]] | None = None

    def concerns(self, effect: Effect) -> bool:
        """Whether the effect can show in this record: a joint that stands tells nothing."""
        return effect.target_kind != "joint" or effect.target in self._moving

    def around(self, effects: Sequence[Effect]) -> Around:
        """What these effects do to the terms of each."""
        heavy = [e for e in effects if self._is_body(e)]
        loaded = self._motion(self.nominal.body)
        for effect in heavy:
            effect.motion(loaded)
        key = tuple(e.key for e in heavy)
        gains: dict[str, float] = {}
        delays: dict[str, float] = {}
        for effect in effects:
            if effect.linear or not self.concerns(effect):
                continue
            term = self._of(effect, loaded.body, key)
            for name, gain in term.gains.items():
                gains[name] = gains.get(name, 1.0) * gain
            for group, delay in term.delays.items():
                delays[group] = delays.get(group, 0.0) + delay
        rests = any(self._rests_on_load(e) for e in effects if e not in heavy)
        return Around(loaded.body, key, gains, delays, rests)

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
        around = self.around(effects)
        torque = {}
        for name, nominal in self.nominal.body.items():
            if joint in (None, name):
                factor = 1.0 if scales is None else scales.get(name, 1.0)
                torque[name] = around.body[name] + (factor - 1.0) * nominal
        ripple = {name: np.zeros(self.log.samples) for name in torque}
        windup = {name: np.zeros(self.log.samples) for name in self.log.link if name in torque}
        found = {TORQUE: torque, RIPPLE: ripple, WINDUP: windup}
        for effect in effects:
            if self.concerns(effect) and (
                joint is None or effect.target_kind != "joint" or effect.target == joint
            ):
                for factor, part in self._parts(effect, around):
                    _add(found, part, factor)
        self._report(found, around)
        for name in windup:
            late = around.delays.get("position", 0.0) - around.delays.get("motor_position", 0.0)
            if late:
                motor = self.log.angle[name]
                windup[name] = windup[name] + shift_smooth(motor, late * self.log.rate) - motor
        return found

    def by_scale(self, around: Around, joint: str) -> Readings:
        """Derivative of the readings by the factor on a joint's rigid-body torque."""
        found: Readings = {TORQUE: {joint: self.nominal.body[joint]}, RIPPLE: {}, WINDUP: {}}
        self._report(found, around)
        return found

    def by_parameter(
        self, around: Around, effect: Effect, other: Effect, name: str, step: float
    ) -> Readings | None:
        """Derivative of the readings by one parameter of an effect.

        Args:
            around: all effects, this one among them or not.
            effect: as it is.
            other: the same with that parameter moved.
            name: the parameter.
            step: by which it was moved (in the coordinate of the derivative).

        Returns:
            None where the effect acts through others' terms, too (masses, gains, delays): the
            whole prediction has to be made twice.
        """
        found: Readings = {TORQUE: {}, RIPPLE: {}, WINDUP: {}}
        if self._is_body(effect) or self._is_body(other):
            if around.loaded:
                return None
            # Of what no other term depends on, the bodies' torques are all that changes.
            before = self._bodies(effect)
            motion = self._motion(self.nominal.body)
            other.motion(motion)
            found[TORQUE] = {
                j: (x - before[j]) / step for j, x in motion.body.items() if x is not before[j]
            }
            self._report(found, around)
            return found
        if not self.concerns(effect):
            return found
        if name in effect.linear:
            parts = [(1.0, part) for part in self._unit(effect, name, around)]
        else:
            for each in () if effect.linear else (effect, other):
                term = self._of(each, around.body, around.key)
                if term.gains or term.delays:
                    return None
            parts = [(f / step, part) for f, part in self._parts(other, around)]
            parts += [(-f / step, part) for f, part in self._parts(effect, around)]
        for factor, part in parts:
            _add(found, part, factor)
        self._report(found, around)
        return found

    def _report(self, found: Readings, around: Around) -> None:
        """What the drives report, and the times at which it was stamped; in place.

        Torques are predicted from measured angles: where those are late, the measured torque is
        early against its prediction.
        """
        for series in (found[TORQUE], found[RIPPLE]):
            for joint in series:
                if (gain := around.gains.get(joint, 1.0)) != 1.0:
                    series[joint] = gain * series[joint]
                late = around.delays.get(TORQUE, 0.0)
                late -= around.delays.get(self.log.group[joint], 0.0)
                if late and np.any(series[joint]):
                    series[joint] = shift(series[joint], late * self.log.rate)

    def _motion(self, body: Mapping[str, FloatArray]) -> Motion:
        return replace(self.nominal, body=dict(body), added=[], gains={}, delays={})

    def _is_body(self, effect: Effect) -> bool:
        """Whether the effect changes what other effects see: the load of the gears."""
        if effect.linear or not self.concerns(effect):
            return False
        kind = type(effect)
        if kind not in self._heavy:
            motion = self._motion(self.nominal.body)
            effect.motion(motion)
            changed = any(motion.body[j] is not x for j, x in self.nominal.body.items())
            if all(effect.values[p.name] == p.neutral for p in effect.parameters):
                return changed
            self._heavy[kind] = changed
        return self._heavy[kind]

    def _bodies(self, effect: Effect) -> Mapping[str, FloatArray]:
        """The bodies' torques with this effect alone; those of the last one are kept."""
        if self._alone is None or self._alone[0] != effect:
            motion = self._motion(self.nominal.body)
            effect.motion(motion)
            self._alone = effect, motion.body
        return self._alone[1]

    def _rests_on_load(self, effect: Effect) -> bool:
        """Whether what an effect adds depends on the load of the gears."""
        if not self.concerns(effect):
            return False
        kind = type(effect)
        if kind not in self._rests:
            motion = self._motion(self.nominal.body)
            motion.body = loads = _Watched(motion.body)
            effect.motion(motion)
            self._rests[kind] = loads.seen
        return self._rests[kind]

    def _parts(self, effect: Effect, around: Around) -> list[tuple[float, Part]]:
        """What an effect adds, each with a factor."""
        if not effect.linear:
            return [(1.0, part) for part in self._of(effect, around.body, around.key).parts]
        return [
            (effect.values[name], part) for name in effect.linear
            if effect.values[name] != 0.0 for part in self._unit(effect, name, around)
        ]  # fmt: skip

    def _unit(self, effect: Effect, name: str, around: Around) -> Parts:
        """What an effect adds for each unit of a parameter that it is linear in."""
        one = effect.with_values(**{other: float(other == name) for other in effect.linear})
        return self._of(one, around.body, around.key).parts

    def _of(self, effect: Effect, body: Mapping[str, FloatArray], key: Hashable) -> _Term:
        """An effect's own term, kept."""
        for known in (effect.key, (effect.key, key)):
            if known in self._terms:
                return self._terms[known]
        if len(self._terms) > _KEPT:
            self._terms.clear()
        motion = self._motion(body)
        motion.body = loads = _Watched(motion.body)
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
        # A term that looked at no load stays when masses change.
        term = self._terms[(effect.key, key) if loads.seen else effect.key] = _Term(
            parts, motion.gains, motion.delays
        )
        return term


class _Watched(dict[str, FloatArray]):
    """Notes whether anything in it was looked at."""

    seen = False

    def __getitem__(self, joint: str) -> FloatArray:
        self.seen = True
        return super().__getitem__(joint)


def _add(found: Readings, part: Part, factor: float) -> None:
    """Add a part; of a derivative's readings, which start empty, the first is the sum."""
    kind, joint, values = part
    target, more = found[kind], values if factor == 1.0 else factor * values
    target[joint] = target[joint] + more if joint in target else more


# From a log to the motion that the model sees: filtered, differentiated, with its torques.


def rigid_motion(robot: FlexibleRobot, log: MotionLog, band: Band) -> Motion:
    """The record's motion and the torques that its rigid bodies take, by Pinocchio.

    Angles and what follows from them are low-passed in `band`. Joints that were not recorded
    stand still.

    Args:
        robot: masses and geometry.
        log: the record.
        band: where to filter.
    """
    q = {joint: band.low_pass(angle) for joint, angle in log.angle.items()}
    v = {joint: band.differentiate(x) for joint, x in q.items()}
    a = {joint: band.differentiate(x) for joint, x in v.items()}
    poses, velocities, accelerations = (
        _stack(robot, x, log.samples, rest) for x, rest in ((q, log.standing), (v, {}), (a, {}))
    )
    torque = robot.rigid.inverse_dynamics(poses, velocities, accelerations)
    _balance(robot, poses, torque)
    index = {joint: i for i, joint in enumerate(robot.joint_names)}

    @cache
    def loads(frame: str) -> dict[str, FloatArray]:
        found = body_loads(robot, frame, poses, velocities, accelerations)
        return {joint: found[:, index[joint]] for joint in q if np.any(found[:, index[joint]])}

    @cache
    def weight() -> dict[str, FloatArray]:
        still = np.zeros_like(poses)
        held = robot.rigid.inverse_dynamics(poses, still, still)
        _balance(robot, poses, held)
        return {joint: held[:, index[joint]] for joint in q if np.any(held[:, index[joint]])}

    stiffness = dict(zip(robot.flexible_names, robot.stiffness, strict=True))
    ratio = {joint.name: joint.gear_ratio for joint in robot.flexible_joints}
    return Motion(
        rate=log.rate,
        angle=q,
        velocity=v,
        acceleration=a,
        still={joint: _still(log, band, joint, x) for joint, x in v.items()},
        body={joint: torque[:, index[joint]] for joint in q},
        stiffness={joint: float(k) for joint, k in stiffness.items()},
        gear_ratio={joint: abs(ratio.get(joint) or 1.0) for joint in q},
        tool=robot.tool_frame,
        loads=loads,
        weight=weight,
        link=lambda link: np.asarray(unit_inertia(robot.tree, link, None).toDynamicParameters()),
    )


def body_loads(
    robot: FlexibleRobot,
    frame: str,
    poses: FloatArray,
    velocities: FloatArray,
    accelerations: FloatArray,
) -> FloatArray:
    """Torques (m, nv, 10) for one of each of the ten numbers of a body fixed in a frame, N m.

    Args:
        robot: kinematics and gravity.
        frame: of a link or the tool.
        poses: (m, nv) rad or m.
        velocities: (m, nv) a second.
        accelerations: (m, nv) a second squared.
    """
    import pinocchio as pin

    rigid = robot.rigid
    model, data = rigid._model, rigid._data()
    place = model.frames[rigid.frame(frame)]
    own = slice(10 * (place.parentJoint - 1), 10 * place.parentJoint)
    found = np.zeros((len(poses), model.nv, 10))
    if place.parentJoint:
        follow = rigid._follow
        for i, state in enumerate(zip(
            poses @ follow.T + rigid._offset, velocities @ follow.T, accelerations @ follow.T,
            strict=True,
        )):  # fmt: skip
            every = np.array(pin.computeJointTorqueRegressor(model, data, *state))
            found[i] = every.reshape(model.nv, -1)[:, own]  # one row comes flattened
    turned = in_frame(place.placement.rotation, place.placement.translation)
    return np.einsum("mjk,jn->mnk", found @ turned, rigid._follow)


def _stack(
    robot: FlexibleRobot, series: dict[str, FloatArray], samples: int, rest: Mapping[str, float]
) -> FloatArray:
    return np.column_stack(
        [
            series[j] if j in series else np.full(samples, rest.get(j, 0.0))
            for j in robot.joint_names
        ]
    )


def _balance(robot: FlexibleRobot, poses: FloatArray, torque: FloatArray) -> None:
    """Add what gravity balancers that the sidecar states leave to the drives."""
    if any(joint.balancer is not None for joint in robot.flexible_joints):
        flexible = robot.flexible_index
        for pose, row in zip(poses, torque, strict=True):
            row[flexible] += balancing(robot.flexible_joints, robot.tree, pose[flexible])[0]


def _still(log: MotionLog, band: Band, joint: str, velocity: FloatArray) -> float:
    """A hundredth of the fastest, or what the encoder's noise alone makes of a standing joint."""
    noise = angle_noise(log.angle[joint]) * np.sqrt(2.0 * band.cutoff / log.rate)
    return max(_STILL * float(np.abs(velocity).max()),
               3.0 * noise * 2.0 * np.pi * band.cutoff / np.sqrt(3.0))  # fmt: skip


def angle_noise(series: FloatArray) -> float:
    """Standard deviation of a reading's noise, from fourth differences, which motion lacks.

    At least what rounding to its resolution makes: a slow or silent reading repeats its steps, and
    its differences are then nothing though its last digit is not known.

    Args:
        series: (m,) of an encoder or a drive.

    Returns:
        in the unit of the series.
    """
    if series.size < 16:
        return 0.0
    fourth = np.diff(series, 4)
    # Var of the fourth difference of white noise: 1 + 16 + 36 + 16 + 1 = 70.
    noise = float(1.4826 * np.median(np.abs(fourth)) / np.sqrt(70.0))
    return max(noise, resolution(series) / np.sqrt(12.0))


def resolution(series: FloatArray) -> float:
    """The step of a reading: the smallest between two of its values; 0 where it never changes.

    Of a reading without steps it is tiny: noise then says more.

    Args:
        series: (m,) of an encoder or a drive.
    """
    values = np.unique(series)
    if values.size < 2:
        return 0.0
    steps = np.diff(values)
    real = steps[steps > _ROUNDED * max(abs(values[0]), abs(values[-1]))]
    return float(real.min()) if real.size else 0.0
