"""What bursts do to the joints: each by the exact model, then together in the order of time."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.core.processes import on_threads
from picchio.excitation.measured import MeasuredForce
from picchio.fatigue.counting.counter import RainflowCounter
from picchio.fatigue.counting.cycles import Cycles
from picchio.fatigue.miner import damage
from picchio.fatigue.shaft_stress import stress_per_torque
from picchio.fatigue.sn.curve import SNCurve
from picchio.ledger.blows import Burst
from picchio.model.many_poses import ManyPoses
from picchio.model.model import Model
from picchio.studies.rivet.pose import ModelAtPose, Rivet
from picchio.studies.rivet.poses import curve_tables, raised
from picchio.studies.tasks import Operation
from picchio.vibration.closed_form.response import RING_DOWN_LEVEL, ring_down

SCALES = np.exp(np.linspace(-0.9, 0.9, 13))
"""Of the load, at which damage is computed: what an error of the force or the strength does."""
AS_LOGGED = 6
"""Which of `SCALES` is 1."""
_BATCH = 128


@dataclass(frozen=True, eq=False)
class BurstDamage:
    """What one burst does to n joints.

    Attributes:
        closed: (n, s) damage of what closes within it, at each of `SCALES`.
        alone: (n, s) of the burst by itself, its residue as half cycles.
        residue: n arrays (r,), turning points of the stress that no cycle has used, Pa or share.
    """

    closed: FloatArray
    alone: FloatArray
    residue: tuple[FloatArray, ...]


def fingerprint(model: Model, curves: Sequence[SNCurve | None]) -> str:
    """What tells a model from one that would count otherwise.

    Args:
        model: the robot and its effects.
        curves: of the flexible joints.
    """
    robot = model.robot
    joints = [
        (joint.name, float(k), float(z), repr(joint.shaft), repr(joint.strength),
         repr(joint.stiffness_curve))
        for joint, k, z in zip(
            robot.flexible_joints, robot.stiffness, robot.damping_ratio, strict=True
        )
    ]  # fmt: skip
    probe = np.linspace(-1.1, 1.3, 3)[:, None] * np.ones(len(robot.joint_names))
    mass, jacobian = ManyPoses(model, probe).mass_and_jacobian()
    told = [joints, repr(model.key("structure", "nonlinear", "over-time")),
            model.gravity_stiffness, model.gravity_balanced,
            [None if c is None else c.to_dict() for c in curves],
            hashlib.sha256(np.concatenate([mass.ravel(), jacobian.ravel()]).tobytes()).hexdigest(),
            SCALES.tolist()]  # fmt: skip
    return hashlib.sha256(json.dumps(told, default=str).encode()).hexdigest()


def resting(model: Model) -> Callable[[FloatArray], FloatArray]:
    """How long the robot rings at poses (p, nv), s.

    Args:
        model: the robot and its effects.
    """

    def times(poses: FloatArray) -> FloatArray:
        if not len(poses):
            return np.empty(0)
        many = ManyPoses(model, poses)
        if not many.compiled:
            return np.array([ring_down(ModelAtPose(model, pose).modes) for pose in poses])
        if not (many.damping_ratio > 0.0).all():
            raise InputError("a joint has no damping: after the blows it rings for ever",
                             key="damping_ratio", value=0.0)  # fmt: skip
        lowest = many.modes()[0][:, 0]
        return np.asarray(-math.log(RING_DOWN_LEVEL) / (many.damping_ratio.min() * lowest))

    return times


def burst_damages_of(
    model: Model, curves: Sequence[SNCurve | None], bursts: Sequence[Burst]
) -> list[BurstDamage]:
    """What each burst does, by itself, from rest.

    Args:
        model: the robot and its effects.
        curves: of the n flexible joints.
        bursts: in any order.
    """
    parts = (bursts[k : k + _BATCH] for k in range(0, len(bursts), _BATCH))
    return [made for part in parts for made in _batch(model, curves, part)]


def _batch(
    model: Model, curves: Sequence[SNCurve | None], bursts: Sequence[Burst]
) -> list[BurstDamage]:
    from picchio.ledger.damage_kernel import MOST, burst_damages

    b, n, s = len(bursts), len(curves), SCALES.size
    many = ManyPoses(model, np.array([burst.pose for burst in bursts]))
    kept = np.full((b, n), -1)
    closed, alone = np.zeros((2, b, n, s))
    residue = np.zeros((b, n, MOST))
    if many.compiled:
        mass, jacobian = many.mass_and_jacobian()
        along = np.ascontiguousarray([burst.direction for burst in bursts])
        per = stress_per_torque(model.robot.flexible_joints, 0.0)
        factor = np.tile(per, (b, 1))
        if any(curve is not None and curve.kind == "torque" for curve in curves):
            factor = factor * raised(curves, factor * many.static_torque(0.0, along))
        begin = np.cumsum([0, *(burst.start.size for burst in bursts)])
        duration = np.concatenate([np.append(np.diff(x.start), np.inf) for x in bursts])
        constant = np.concatenate([burst.constant for burst in bursts])
        slope = np.concatenate([burst.slope for burst in bursts])
        _, knots, lines, known = curve_tables(curves)
        on_threads(
            burst_damages, b, 1, begin, duration, constant, slope, mass, jacobian, many.stiffness,
            np.asarray(many.damping_ratio, float), along, factor, knots, lines, known, SCALES,
            closed, alone, residue, kept,
        )  # fmt: skip
    return [
        _exactly(model, curves, burst) if kept[i, 0] < 0 else
        BurstDamage(closed[i].copy(), alone[i].copy(),
                    tuple(residue[i, j, : kept[i, j]].copy() for j in range(n)))
        for i, burst in enumerate(bursts)
    ]  # fmt: skip


def _exactly(model: Model, curves: Sequence[SNCurve | None], burst: Burst) -> BurstDamage:
    """One burst by the path that takes every model."""
    # Straight lines between these, a jump within a picosecond.
    end = np.append(burst.start[1:], burst.start[-1] + 1e-12)
    value = burst.constant + burst.slope * (end - burst.start)
    time = np.column_stack([burst.start, np.maximum(end - 1e-12, burst.start + 1e-13)]).ravel()
    rises = np.append(True, np.diff(np.maximum.accumulate(time)) > 0.0)
    force = np.column_stack([burst.constant, value]).ravel()
    excitation = MeasuredForce(time[rises], force[rises], float(time[-1]) + 1e-9)
    operation = Operation("", burst.direction, excitation, 1, burst.pose[None])
    loads = Rivet(model, operation, burst.pose).loads("rest", both=False)
    n = len(curves)
    closed, alone, residue = np.zeros((n, SCALES.size)), np.zeros((n, SCALES.size)), []
    for j, (joint, load, curve) in enumerate(
        zip(model.robot.flexible_joints, loads, curves, strict=True)
    ):
        assert load.rest is not None
        if curve is None:
            residue.append(np.empty(0))
            continue
        steady = load.static_stress(joint)
        per = joint.per_torque * load.stiffness * float(curve.raised_by(steady))
        counter = RainflowCounter()
        counter.add(per * load.rest)
        for s, scale in enumerate(SCALES):
            closed[j, s] = damage(counter.cycles("discarded").scaled(scale), curve)
            alone[j, s] = damage(counter.cycles("half-cycles").scaled(scale), curve)
        residue.append(counter.residue)
    return BurstDamage(closed, alone, tuple(residue))


@dataclass(frozen=True, eq=False)
class Totals:
    """The damage of all bursts.

    Attributes:
        damage: (n,) Miner's sum of each joint; NaN without a curve.
        scaled: (n, s) at each of `SCALES` of the load.
        alone: (n,) the sum of the bursts each by itself, as `assess` has it.
    """

    damage: FloatArray
    scaled: FloatArray
    alone: FloatArray

    def at(self, scale: FloatArray) -> FloatArray:
        """(n, m) the damage were the load so many times as large.

        Args:
            scale: (m,) factors; beyond `SCALES` the outermost slope goes on.
        """
        from scipy.interpolate import make_interp_spline

        # exp(-700) stands for nothing, and what lies between it and something is nothing, too.
        values = np.log(np.where(self.scaled > 0.0, self.scaled, np.exp(-700.0)))
        found = make_interp_spline(np.log(SCALES), values, k=1, axis=1)(np.log(scale))
        return np.where(found > -600.0, np.exp(np.minimum(found, 700.0)), 0.0)


class Sum:
    """Bursts in the order of time: what closes within each, and what their residues close.

    Counting the residues one after the other is counting the whole history: the four-point rule
    takes the same cycles out of it in either way. Only what no cycle has used yet is held.

    Args:
        curves: of the n joints.
    """

    def __init__(self, curves: Sequence[SNCurve | None]) -> None:
        self._scaled = np.zeros((len(curves), SCALES.size))
        self._open = {j: (c, RainflowCounter()) for j, c in enumerate(curves) if c is not None}
        self._waiting: list[tuple[FloatArray, ...]] = []
        self.alone: FloatArray = np.array([np.nan if c is None else 0.0 for c in curves])

    def add(self, found: Sequence[BurstDamage]) -> None:
        """Further bursts.

        Args:
            found: by time.
        """
        self._scaled += np.sum([each.closed for each in found], axis=0)
        self.alone += np.sum([each.alone[:, AS_LOGGED] for each in found], axis=0)
        self._waiting += [each.residue for each in found]
        if len(self._waiting) >= _BATCH:
            self._join()

    def _join(self) -> None:
        """Count the residues that wait; a few at a time would take as long as many."""
        waiting, self._waiting = self._waiting, []
        for j, (curve, counter) in self._open.items():
            counter.add(np.concatenate([np.empty(0), *(each[j] for each in waiting)]))
            self._scaled[j] += _costs(counter.taken(), curve)

    @property
    def burst(self) -> BurstDamage:
        """All bursts so far as one."""
        self._join()
        closed, residue = self._scaled.copy(), [np.empty(0)] * len(self.alone)
        for j, (curve, counter) in self._open.items():
            closed[j] += _costs(counter.cycles("discarded"), curve)
            residue[j] = counter.residue
        alone = np.tile(np.nan_to_num(self.alone)[:, None], SCALES.size)
        return BurstDamage(closed, alone, tuple(residue))

    @property
    def totals(self) -> Totals:
        """Of all bursts so far, what is left of the residues as half cycles."""
        self._join()
        scaled = self._scaled.copy()
        for j, (curve, counter) in self._open.items():
            scaled[j] += _costs(counter.cycles(), curve)
        return Totals(scaled[:, AS_LOGGED] + 0.0 * self.alone, scaled, self.alone.copy())


def _costs(cycles: Cycles, curve: SNCurve) -> FloatArray:
    """(s,) the damage at each of `SCALES`."""
    return np.array([damage(cycles.scaled(scale), curve) for scale in SCALES])


def unscaled(model: Model) -> Model:
    """The model without effects on the blows, which were measured as they are.

    Args:
        model: the robot and its effects.
    """
    kept = tuple(effect for effect in model.effects if effect.where != "blows")
    if kept == model.effects:
        return model
    return replace(model, robot=replace(model.robot, effect_tables=()), effects=kept, own=())
