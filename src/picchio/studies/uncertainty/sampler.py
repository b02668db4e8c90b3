"""Runs drawn worlds: values of the robot, its blows and its material, each with its own draw."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from statistics import NormalDist
from typing import Any

import numpy as np

from picchio.core.arrays import FloatArray, IndexArray
from picchio.core.processes import on_threads
from picchio.fatigue.counting.counter import rainflow
from picchio.fatigue.counting.cycles import Cycles
from picchio.fatigue.miner import damage, utilisation
from picchio.fatigue.shaft_stress import stress_per_torque
from picchio.fatigue.sn.curve import SNCurve
from picchio.fatigue.uncertain_lives import Uncertain
from picchio.model.effects.structure.springs.joint_stiffness import JointStiffness
from picchio.model.many_poses import ManyPoses
from picchio.model.model import Model
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.spread import Spread, is_estimate
from picchio.robot.varied import robot_with
from picchio.studies.rivet.pose import Rivet
from picchio.studies.rivet.poses import curve_tables, raised, stacked
from picchio.studies.rivet.variation import WornParts
from picchio.studies.tasks import Operation, Task
from picchio.studies.uncertainty.drawn import Drawn, interval
from picchio.studies.uncertainty.inputs import OF_JOINTS, Input, inputs_of
from picchio.studies.uncertainty.result import LifeScan

# Of a stiffness at once, by an effect.
_MOST_SCALED = 49.0
# Rows of a batch; steps of a scan.
_BATCH, _SCAN = 20_000, 41


@dataclass(frozen=True)
class Sampler:
    """Lives of the sampled worlds.

    Attributes:
        model: the robot and its effects, as stated.
        task: its work.
        stress: the joints that count.
        inputs: what varies.
    """

    model: Model
    task: Task
    stress: WornParts
    inputs: tuple[Input, ...]

    @classmethod
    def of(
        cls,
        model: Model,
        task: Task,
        stress: WornParts,
        given: Mapping[str, Uncertain] | None,
        notes: list[str],
    ) -> Sampler:
        """With every input that has an effect.

        Args:
            model: as of `inputs_of`, like the others.
            task: its work.
            stress: the joints with shafts, and their curves.
            given: what is asked for, by name.
            notes: what has no effect is added to these.
        """
        sampler = cls(model, task, stress, inputs_of(model, task, stress, given, notes))
        idle = sampler.without_effect()
        if not idle:
            return sampler
        notes.append(f"without effect on the life by this method: the spread of {', '.join(idle)}")
        kept = tuple(each for each in sampler.inputs if each.name not in idle)
        return cls(model, task, stress, kept)

    @cached_property
    def _places(self) -> list[ManyPoses]:
        return [ManyPoses(self.model, op.poses) for op in self.task.operations]

    @cached_property
    def _bursts(self) -> dict[str, tuple[Any, list[Any]]]:
        return {}

    @property
    def _modal(self) -> bool:
        """Whether compiled code can take the dynamics."""
        return all(many.compiled for many in self._places)

    @property
    def _plain(self) -> bool:
        """Whether compiled code can count the damage, too."""
        return self.stress.residue == "half-cycles" and self.stress.mean_stress == "none"

    @property
    def rebuilt(self) -> bool:
        """Whether a drawn world needs another robot: masses, say, and not springs alone."""
        return any(each.spread is not None for each in self.inputs)

    def elsewhere(self, task: Task) -> Sampler:
        """The same worlds at the places of another task.

        Args:
            task: its work; bursts are made anew only where the blows are others.
        """
        moved = Sampler(self.model, task, self.stress, self.inputs)
        same = [(op.name, op.excitation, op.hits_per_rivet) for op in self.task.operations]
        if same == [(op.name, op.excitation, op.hits_per_rivet) for op in task.operations]:
            moved._bursts.update(self._bursts)
        return moved

    @property
    def budget(self) -> int:
        """Samples at most, by what one takes: micro-, tenths of or whole milliseconds a place."""
        if not self._modal or (self.rebuilt and not self._plain):
            return 256
        return 16_384 if self._plain and not self.rebuilt else 2_048 if self._plain else 512

    def run(self, moved: FloatArray, force: FloatArray | None = None) -> Drawn:
        """What drawn worlds do.

        Args:
            moved: (m, inputs) normal scores, correlated.
            force: (m,) further factors on the vibration of a linear model; 1 if not given.
        """
        rows = max(1, _BATCH // max(1, sum(len(op.poses) for op in self.task.operations)))
        force = np.ones(len(moved)) if force is None else force
        return Drawn.joined(
            [
                self._batch(_Draw.of(self, moved[k : k + rows], force[k : k + rows]))
                for k in range(0, len(moved), rows)
            ]
        )

    def _batch(self, draw: _Draw) -> Drawn:
        k, n = len(self.stress.joints), len(self.model.robot.flexible_joints)
        spent, used = np.zeros((2, k, draw.count))
        peak, held = np.zeros((2, n, draw.count))
        plain = self._modal and self._plain
        for op, many in zip(self.task.operations, self._places, strict=True):
            found = self._compiled(draw, op, many) if plain else self._one_by_one(draw, op)
            spent += op.rivets * found[0].sum(axis=2)
            for most, values in zip((used, peak, held), found[1:], strict=True):
                np.maximum(most, values.max(axis=2), out=most)
        spent /= self.task.rivets_per_pass
        with np.errstate(divide="ignore"):
            lives = np.where(spent > 0.0, 1.0 / spent, np.inf)
        strength = [curve.static_strength for curve in self.stress.curves]
        per = stress_per_torque(self.stress.joints) / np.array(strength)
        yielding = peak[self._columns] * per[:, None] * draw.thinner.T
        # Each limit of a reducer is for one of the two, so their largest values give its share.
        geared = np.full_like(peak, np.nan)
        for row, joint in enumerate(self.model.robot.flexible_joints):
            if joint.ratings is not None:
                shares = joint.ratings.shares(peak[row], held[row])
                geared[row] = np.max(list(shares.values()), axis=0) / draw.bears[:, row]
        return Drawn(lives, used, yielding, peak, geared)

    @property
    def _shafts_only(self) -> bool:
        return all(curve.kind == "shear" for curve in self.stress.curves)

    @property
    def _columns(self) -> IndexArray:
        return np.array(self.stress.columns, dtype=np.int64)

    def intervals(self, drawn: Drawn) -> dict[str, dict[str, tuple[float, float]]]:
        """P10 and P90 of what each flexible joint's parts bear.

        Args:
            drawn: worlds, in one or more dimensions.

        Returns:
            joint -> "peak_torque" (N m), "utilisation", "yield_utilisation" and
            "reducer_utilisation" as far as they are known.
        """
        found: dict[str, dict[str, tuple[float, float]]] = {}
        column = {int(j): row for row, j in enumerate(self.stress.columns)}
        for j, joint in enumerate(self.model.robot.flexible_joints):
            parts = {"peak_torque": drawn.peak[j], "reducer_utilisation": drawn.geared[j]}
            if j in column:
                parts["utilisation"] = drawn.used[column[j]]
                parts["yield_utilisation"] = drawn.yielding[column[j]]
            found[joint.name] = {
                key: interval(values) for key, values in parts.items() if not np.isnan(values).any()
            }
        return found

    def _compiled(
        self, draw: _Draw, op: Operation, nominal: ManyPoses
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Damage and utilisation (k, m, p), peak torque and the torque at rest (n, m, p)."""
        from picchio.studies.rivet.damage_kernel import SPAN, damages
        from picchio.vibration.batch.turning_kernel import COARSE, FINE

        m, p = draw.count, len(op.poses)
        worlds = [nominal]
        if self.rebuilt:
            models = (replace(self.model, robot=draw.robot(d)) for d in range(m))
            worlds = [ManyPoses(model, op.poses) for model in models]
        matrices = [world.mass_and_jacobian() for world in worlds]
        mass = np.concatenate([mass for mass, _ in matrices])
        jacobian = np.concatenate([jacobian for _, jacobian in matrices])
        springs = np.concatenate([world.stiffness for world in worlds])
        static = np.concatenate(
            [world.static_torque(op.excitation.preload, op.direction) for world in worlds]
        )
        ratio = np.array([world.damping_ratio for world in worlds])
        d, place = np.repeat(np.arange(m), p), np.tile(np.arange(p), m)
        world = d if self.rebuilt else np.zeros_like(d)
        place = place + p * world
        forces = draw.forces(op)
        curves: list[SNCurve | None] = [None] * springs.shape[1]
        for column, curve in zip(self.stress.columns, self.stress.curves, strict=True):
            curves[column] = curve
        factor = np.zeros((m * p, springs.shape[1]))
        columns, per = self._columns, stress_per_torque(self.stress.joints)
        factor[:, columns] = (per * draw.load)[d]
        if not self._shafts_only:
            steady = static[place][:, columns] * (per * draw.thinner)[d]
            factor[:, columns] *= raised(self.stress.curves, steady)
        frequency, low, high, damaged = np.full((4, m * p, springs.shape[1]), np.nan)
        stiffness = springs[place] * draw.stiffness[d]
        on_threads(
            damages, m * p, SPAN,
            *stacked(forces), mass, jacobian, d if len(forces) > 1 else np.zeros_like(d), place,
            stiffness, ratio[world] * draw.damping[d], np.tile(op.direction, (len(mass), 1)),
            factor, *curve_tables(curves), frequency, low, high, damaged,
            COARSE if any(each.estimated for each in self.inputs) else FINE,
        )  # fmt: skip
        allowable = np.array([curve.allowable for curve in self.stress.curves])
        loaded = 0.5 * (stiffness * (high - low) * factor)[:, columns] / allowable
        damaged = damaged[:, columns]
        turned = stiffness * draw.vibration[d][:, None]
        rest = static[place]
        peak = np.maximum(np.abs(rest + turned * low), np.abs(rest + turned * high))
        held = np.abs(rest)
        for row in np.flatnonzero(np.isnan(low[:, 0])):  # a mode that is not underdamped
            one = self._one(draw, int(d[row]), op, int(row) % p)
            damaged[row], loaded[row], peak[row], held[row] = one

        def shaped(values: FloatArray) -> FloatArray:
            return np.asarray(values.reshape(m, p, -1).transpose(2, 0, 1))

        return shaped(damaged), shaped(loaded), shaped(peak), shaped(held)

    def _one_by_one(
        self, draw: _Draw, op: Operation
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """As `_compiled`, for any model and any rule."""
        found = [
            [self._one(draw, d, op, i) for i in range(len(op.poses))] for d in range(draw.count)
        ]
        damaged, loaded, peak, held = (
            np.array([[one[part] for one in row] for row in found]).transpose(2, 0, 1)
            for part in range(4)
        )
        return damaged, loaded, peak, held

    def _one(
        self, draw: _Draw, d: int, op: Operation, i: int
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Damage and utilisation (k,), peak torque and torque at rest (n,), at one place."""
        found = []
        loads = list(draw.loads(d, op, i))
        for k, (joint, column) in enumerate(
            zip(self.stress.joints, self.stress.columns, strict=True)
        ):
            rest, stiffness, static = loads[column]
            cycles = rainflow(joint.per_torque * stiffness * rest, residue=self.stress.residue)
            curve = self.stress.curves[k]
            # On both sides of the curve: as the kernel has it.
            steady = joint.per_torque * static * draw.thinner[d, k]
            factor = draw.load[d, k] * float(curve.raised_by(steady))
            load = Cycles.trusted(
                factor * cycles.range, factor * cycles.mean + steady, cycles.count
            )
            rule = self.stress.mean_stress if curve.kind == "shear" else "none"
            found.append((damage(load, curve, rule), utilisation(load, curve, rule)))
        damaged, loaded = np.array(found).reshape(-1, 2).T
        peak = [
            np.abs(static + draw.vibration[d] * stiffness * np.append(rest, 0.0)).max()
            for rest, stiffness, static in loads
        ]
        return damaged, loaded, np.array(peak), np.abs([static for _, _, static in loads])

    @cached_property
    def static_torque(self) -> list[list[FloatArray]]:
        """Of every place, (n,) N m before the first blow: no stiffness changes it."""
        return [
            [
                Rivet(self.model, op, pose).static_torque(op.excitation, op.direction)
                for pose in op.poses
            ]
            for op in self.task.operations
        ]

    def without_effect(self) -> list[str]:
        """The inputs that need another robot, and leave its lives and torques as they are."""
        asked = [i for i, each in enumerate(self.inputs) if each.spread is not None]
        if not asked:
            return []
        moved = np.zeros((len(asked) + 1, len(self.inputs)))
        moved[np.arange(1, len(asked) + 1), asked] = 1.0
        found = np.nan_to_num(np.concatenate(self.run(moved)))
        same = (found == found[:, :1]).all(axis=0)
        return [self.inputs[i].name for k, i in enumerate(asked) if same[k + 1]]

    def scans(self) -> dict[str, LifeScan]:
        """The stiffnesses along which the robot's life turns.

        Not those of picchio's own estimates: where no joint's is known, one alone tells nothing.
        """
        found = {}
        score = np.linspace(-2.0, 2.0, _SCAN)
        for i, each in enumerate(self.inputs):
            if each.key != "stiffness" or is_estimate(each.source):
                continue
            moved = np.zeros((_SCAN, len(self.inputs)))
            moved[:, i] = score
            scan = LifeScan(each.uncertain.at(score), self.run(moved).robots_life)
            if scan.turns:
                found[each.name] = scan
        return found


@dataclass(frozen=True)
class _Draw:
    """Some drawn worlds: m of them.

    Attributes:
        sampler: what they are drawn for.
        stiffness: (m, n) factors on the flexible joints' stiffness.
        damping: (m, n) factors on their damping ratios.
        thinner: (m, k) factors on the stress of the joints that count, by their shafts' radii or
            by what their drives bear.
        bears: (m, n) factors on what the flexible joints' drives bear.
        vibration: (m,) all factors on the torques of the vibration.
        load: (m, k) all factors on the stress of the vibration, strength included.
        width: (m,) factors on the blows' width.
        force: (m,) factors on the blows' force, where that is not a factor on the stress.
        others: spreads of values that need another robot, and their (m,) scores.
    """

    sampler: Sampler
    stiffness: FloatArray
    damping: FloatArray
    thinner: FloatArray
    bears: FloatArray
    vibration: FloatArray
    load: FloatArray
    width: FloatArray
    force: FloatArray
    others: list[tuple[Spread, FloatArray]]

    @property
    def count(self) -> int:
        """How many worlds, m."""
        return len(self.width)

    @classmethod
    def of(cls, sampler: Sampler, moved: FloatArray, further: FloatArray) -> _Draw:
        """From normal scores (m, inputs), and further factors (m,) on a linear vibration."""
        m, n = len(moved), len(sampler.model.robot.flexible_joints)
        of_joints = {key: np.ones((m, n)) for key in OF_JOINTS}
        whole = {key: np.ones(m) for key in ("force", "width", "model", "strength")}
        others = []
        for i, each in enumerate(sampler.inputs):
            if each.spread is not None:
                size = replace(each.spread, size=each.uncertain.spread)
                others.append((size, moved[:, i]))
                continue
            values = each.uncertain.at(moved[:, i])
            if each.joints:
                of_joints[each.key][:, list(each.joints)] *= values[:, None]
            else:
                whole[each.key] = values
        stress = sampler.stress
        shafts = np.array([joint.shaft is not None for joint in stress.joints], dtype=bool)
        columns = sampler._columns
        thinner = np.where(
            shafts, of_joints["radius"][:, columns] ** -3.0, 1.0 / of_joints["bears"][:, columns]
        )
        score = np.log(whole["strength"])
        strength = np.array([_strength(curve, score) for curve in stress.curves]).reshape(-1, m).T
        # Only of a linear model is the load proportional to the force.
        force, vibration = whole["force"], whole["model"] * further
        if not sampler.model.nonlinear:
            vibration, force = vibration * force, np.ones(m)
        load = vibration[:, None] * thinner / strength
        return cls(sampler, of_joints["stiffness"], of_joints["damping_ratio"], thinner,
                   of_joints["bears"], vibration, load, whole["width"], force, others)  # fmt: skip

    def robot(self, d: int) -> FlexibleRobot:
        """The robot of world d, but for stiffness, damping and radii."""
        values = [(spread, spread.at(float(score[d]))) for spread, score in self.others]
        return robot_with(self.sampler.model.robot, values)

    def blows(self, d: int, op: Operation) -> Operation:
        """The operation in world d."""
        scaled = op.excitation.scaled(force=float(self.force[d]), width=float(self.width[d]))
        return replace(op, excitation=scaled)

    def forces(self, op: Operation) -> list[Any]:
        """The bursts of all worlds; one where they are the same."""
        worlds = range(self.count) if (self.width != self.width[0]).any() else range(1)
        # The last ones are kept: of the same cases much is asked.
        kept, key = self.sampler._bursts, (self.width.tobytes(), self.force.tobytes())
        if kept.get(op.name, (None,))[0] != key:
            model = self.sampler.model
            bursts = [model.force(self.blows(d, op).excitation, op.hits_per_rivet) for d in worlds]
            kept[op.name] = (key, bursts)
        return kept[op.name][1]

    def loads(self, d: int, op: Operation, i: int) -> Iterator[tuple[FloatArray, float, float]]:
        """Every joint's turning points, rad, stiffness and static torque, N m, at a place."""
        sampler = self.sampler
        which = next(k for k, each in enumerate(sampler.task.operations) if each is op)
        if sampler._modal and not self.others:
            from picchio.studies.rivet.damage_kernel import swing
            from picchio.vibration.batch.turning_kernel import FINE

            many = sampler._places[which]
            mass, jacobian = many.mass_and_jacobian()
            stiffness = many.stiffness[i] * self.stiffness[d]
            force = sampler.model.force(self.blows(d, op).excitation, op.hits_per_rivet)
            burst = [part[0] for part in stacked([force])]
            turns, count = swing(
                mass[i], jacobian[i], stiffness, many.damping_ratio * self.damping[d],
                op.direction, np.full(len(stiffness), -1.0), burst[0], burst[1], burst[2],
                burst[3], burst[4], np.empty(len(stiffness)), FINE,
            )  # fmt: skip
            if len(count):
                static = sampler.static_torque[which][i]
                for row, k, spring, torque in zip(turns, count, stiffness, static, strict=True):
                    yield row[:k], float(spring), float(torque)
                return
        rivet = Rivet(self._model(d), self.blows(d, op), op.poses[i])
        for load in rivet.loads("rest", both=False):
            assert load.rest is not None
            yield load.rest, load.stiffness, load.stiffness * load.static

    def _model(self, d: int) -> Model:
        """The whole model of world d."""
        model, robot = self.sampler.model, self.robot(d)
        factors = zip(robot.flexible_joints, self.damping[d], strict=True)
        joints = tuple(replace(j, damping_ratio=f * j.damping_ratio) for j, f in factors)
        # Factors go onto the springs as the effects leave them; one effect takes no more than 50.
        effects = [
            JointStiffness(joint.name, scale=float(factor) ** (1.0 / parts))
            for joint, factor in zip(joints, self.stiffness[d], strict=True)
            if factor != 1.0
            for parts in [math.ceil(abs(math.log(factor)) / math.log(_MOST_SCALED))]
            for _ in range(parts)
        ]
        varied = replace(model, robot=replace(robot, flexible_joints=joints))
        return replace(varied, effects=(*model.effects, *effects)) if effects else varied


def _strength(curve: SNCurve, score: FloatArray) -> FloatArray:
    """Specimens' strength over the curve's: 1 where the curve has no scatter."""
    if curve.survival is None or not curve.scatter:
        return np.ones_like(score)
    return np.asarray(10.0 ** (curve.scatter * (score + NormalDist().inv_cdf(curve.survival))))
