"""How sure a life is: stiffness, damping, blows, strength and the model itself as distributions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np

from picchio.core.arrays import FloatArray, IndexArray
from picchio.core.errors import InputError
from picchio.core.html import sheet
from picchio.core.processes import one_thread
from picchio.core.results import TableResult
from picchio.fatigue.counting.counter import Residue, rainflow
from picchio.fatigue.counting.cycles import Cycles
from picchio.fatigue.mean_stress import Rule
from picchio.fatigue.miner import damage, format_count, utilisation
from picchio.fatigue.shaft_stress import shear_stress, stress_per_torque
from picchio.fatigue.sn.curve import SNCurve
from picchio.fatigue.uncertain_lives import Draws, LifeSpread, Uncertain, summarise
from picchio.model.effects.structure.joint_stiffness import JointStiffness
from picchio.model.many_poses import ManyPoses
from picchio.model.model import Model
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.spread import ESTIMATED, Spread, root_of
from picchio.robot.varied import robot_with
from picchio.studies.rivet.pose import Rivet
from picchio.studies.rivet.poses import curve_tables, stacked
from picchio.studies.rivet.variation import ShaftStress
from picchio.studies.tasks import Operation, Task

# Relative, as the campaign's tolerances; the width and the model's error are judgements.
DEFAULT_INPUTS: dict[str, Uncertain] = {
    "stiffness": Uncertain(1.0, 0.05),
    "damping_ratio": Uncertain(1.0, 0.20),
    "force": Uncertain(1.0, 0.05),
    "width": Uncertain(1.0, 0.05),
    "model": Uncertain(1.0, 0.10),
}
# Samples go on until the ends of every sampling interval are this near to each other.
_NEAR = 1.2
# Draws of a replicate for the total-order indices; rows of a batch; steps of a scan.
_MIXED, _BATCH, _SCAN = 8, 20_000, 41
# A life that falls and rises again by more than this along a stiffness is shown.
_TURN = 0.02


def default_inputs(task: Task) -> dict[str, Uncertain]:
    """`DEFAULT_INPUTS`, without the width where a blow of the task states none.

    Args:
        task: the work.

    Returns:
        the factors by name.
    """
    known = all(operation.excitation.width is not None for operation in task.operations)
    return {name: each for name, each in DEFAULT_INPUTS.items() if known or name != "width"}


@dataclass(frozen=True)
class LifeScan:
    """The robot's life against one stiffness, everything else as stated.

    Attributes:
        factor: (k,) on the stiffness.
        life: (k,) rivets of the task's mix; infinite where the life has no end.
    """

    factor: FloatArray
    life: FloatArray

    @property
    def turns(self) -> bool:
        """Whether the life both falls and rises as the stiffness grows: a resonance."""
        with np.errstate(invalid="ignore"):
            steps = np.diff(np.log(np.minimum(self.life, 1e300)))
        return bool((steps > _TURN).any() and (steps < -_TURN).any())

    def turning_points(self) -> FloatArray:
        """Where the life turns.

        Returns:
            indices of the ends and of the local extremes, ascending.
        """
        log = np.log(np.minimum(self.life, 1e300))
        slope = np.sign(np.round(np.diff(log), 6))
        moving = np.flatnonzero(slope)
        turns = moving[1:][slope[moving[1:]] != slope[moving[:-1]]]
        return np.unique(np.concatenate([[0], turns, [log.size - 1]]))


@dataclass(frozen=True, repr=False)
class UncertainLife(TableResult):
    """Lives as distributions.

    Attributes:
        joints: of each joint with a shaft, rivets of the task's mix.
        robot: of the weakest joint, sample by sample.
        inputs: what was varied: factors on the nominal values ("absolute": the values); of
            "strength", ln is the specimens' standard normal score, which each curve's own scatter
            multiplies.
        sources: where each spread is from.
        estimated: the inputs that are estimates without a stated spread.
        scans: stiffnesses along which the life is not monotone (resonance): life against a factor.
        assumptions: what was taken for granted.
        seed: of the samples.
        lives: (samples,) of the robot, replicate after replicate; not in the JSON.
        intervals: of each flexible joint the P10 and P90 of what its parts bear: "utilisation",
            "yield_utilisation" and "reducer_utilisation", where it has such a part, and
            "peak_torque", N m (N of a slide), gravity and blows together.
    """

    joints: dict[str, LifeSpread]
    robot: LifeSpread
    inputs: dict[str, Uncertain]
    sources: dict[str, str]
    estimated: tuple[str, ...]
    scans: dict[str, LifeScan]
    assumptions: tuple[str, ...]
    seed: int
    lives: FloatArray = field(default_factory=lambda: np.empty(0))
    intervals: dict[str, dict[str, tuple[float, float]]] = field(default_factory=dict)

    def spread_words(self, name: str) -> str:
        """How much an input varies, in words.

        Args:
            name: of the input.
        """
        each = self.inputs[name]
        if name == "strength":
            return "as the specimens do"
        if each.shape != "lognormal":
            return f"+- {each.spread:.3g}"
        text = f"a factor of {math.exp(each.spread):.3g}"
        return f"{text} (estimate)" if name in self.estimated else text

    def doubt(self) -> str:
        """Why the life is an interval, in a sentence."""
        most = max(self.robot.shares, key=lambda name: self.robot.shares[name])
        guessed = ", ".join(self.estimated)
        why = f" ({guessed}: estimated, a factor of {ESTIMATED:g})" if guessed else ""
        return (
            f"values are uncertain{why}: rivets to failure are an interval that holds 80 % of the "
            f"cases; {most} matters most, {100 * self.robot.shares[most]:.0f} % of the variance of "
            "the logarithm of the utilisation"
        )

    def _repr_html_(self) -> str:
        rows = [
            (name, *(format_count(s.rounded(key)) for key in s.quantiles), 100 * s.endless)
            for name, s in {**self.joints, "robot": self.robot}.items()
        ]
        columns = ("rivets to failure", "P10", "P50", "P90", "without end [%]")
        return sheet("How sure the life is", {"varied": ", ".join(self.inputs)}, columns, rows)

    def _headline(self) -> str:
        lives = (format_count(self.robot.rounded(key)) for key in self.robot.quantiles)
        return "rivets to failure P10 {}, P50 {}, P90 {}".format(*lives)

    def _rows(self) -> list[dict[str, Any]]:
        spreads = {**self.joints, "robot": self.robot}
        return [
            {"name": name, "p10": s.p10, "p50": s.p50, "p90": s.p90, "endless": s.endless}
            for name, s in spreads.items()
        ]

    def _content(self) -> dict[str, Any]:
        return {key: value for key, value in vars(self).items() if key != "lives"}


@one_thread()
def uncertain_life(
    robot: FlexibleRobot | Model,
    task: Task,
    *,
    sn_curve: str | SNCurve | None = None,
    inputs: Mapping[str, Uncertain] | None = None,
    samples: int | None = None,
    seed: int = 0,
    totals: bool = True,
    residue: Residue = "half-cycles",
    mean_stress: Rule = "none",
    gravity_stiffness: bool | None = None,
    gravity_balanced: bool | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> UncertainLife:
    """P10, P50 and P90 of every joint's life, and what makes them uncertain.

    Rivets start from rest and ring down, cycles are counted by rainflow (`assess`'s default).
    Values with a spread of their own (`FlexibleRobot.spreads`) vary by it, correlated as the
    robot's posterior says. One factor is common to the stiffness of all other joints, and one to
    their damping. Specimens' strength scatters as each curve says, one rank for all joints; a
    curve without scatter counts as certain.

    Samples are doubled until every quantile of the robot's life is known within a factor of 1.2
    (the ends of its 95 % sampling interval), or `samples` are done.

    Args:
        robot: with shafts or reducers; or a model of it.
        task: what it does.
        sn_curve: for all joints, instead of their own.
        inputs: factors on the nominal values, by name: "stiffness", "damping_ratio", "force",
            "width" (of the blows), "model" (error of the computed stress); if not given,
            `DEFAULT_INPUTS`, without the width where blows have none. One joint's stiffness or
            damping ratio ("stiffness.joint_1"), or any other value with a spread, by its name:
            in place of its own spread.
        samples: at most so many; if not given, 16,384, and fewer for models that compiled code
            cannot take.
        seed: the same seed gives the same result.
        totals: also the total-order indices, which need more runs.
        residue: as in `assess`.
        mean_stress: as in `assess`.
        gravity_stiffness: as in `assess`.
        gravity_balanced: as in `assess`.
        progress: called with (samples done, samples at most).

    Returns:
        the lives as distributions.

    Raises:
        InputError: no joint with a shaft or reducer, an unknown input, a width where blows have
            none.
    """
    model = Model.of(robot, gravity_stiffness=gravity_stiffness, gravity_balanced=gravity_balanced)
    geared = any(joint.reducer for joint in model.robot.flexible_joints)
    stress = ShaftStress.of(model.robot, sn_curve, None, residue, mean_stress, needed=not geared)
    notes: list[str] = []
    sampler = _Sampler.of(model, task, stress, inputs, notes)
    names = [each.name for each in sampler.inputs]
    root = root_of(names, model.robot.posterior)
    draws = Draws(len(names), seed)
    most = samples or sampler.budget
    drawn: Drawn | None = None
    mixed = None
    while True:
        new = draws.more()
        found = sampler.run(new.reshape(-1, len(names)) @ root)
        found = Drawn(*(part.reshape(-1, *new.shape[:2]) for part in found))
        drawn = found if drawn is None else Drawn.joined([drawn, found], axis=2)
        lives, used = drawn.lives, drawn.used
        done = draws.scores.shape[0] * draws.scores.shape[1]
        if progress is not None:
            progress(min(done, most), most)
        weakest = summarise(names, draws.scores, drawn.robots_life, drawn.robots_use)
        if 2 * done > most or (done >= _FEWEST and weakest.settled(_NEAR)):
            break
    if totals:
        rows = draws.mixed(_MIXED) @ root
        again = sampler.run(rows.reshape(-1, len(names)))
        mixed = again.used.reshape(len(used), len(names), -1)
        mixed_robot = again.robots_use.reshape(len(names), -1)
    spreads = {
        joint.name: summarise(
            names, draws.scores, lives[k], used[k], None if mixed is None else mixed[k]
        )
        for k, joint in enumerate(stress.joints)
        if (used[k] > 0).all() and (mixed is None or (mixed[k] > 0).all())
    }
    posterior = model.robot.posterior
    if posterior is not None and posterior.among(names) is not None:
        notes.append(
            "correlated values share independent normal factors by the symmetric root of their "
            "correlation matrix; a share is that of the factor nearest to its value"
        )
    return UncertainLife(
        joints=spreads,
        robot=summarise(
            names,
            draws.scores,
            drawn.robots_life,
            drawn.robots_use,
            None if mixed is None else mixed_robot,
        ),
        inputs={each.name: each.uncertain for each in sampler.inputs},
        sources={each.name: each.source for each in sampler.inputs},
        estimated=tuple(each.name for each in sampler.inputs if each.estimated),
        scans=sampler.scans(),
        assumptions=(
            "values with a spread of their own vary by it, one factor on the stiffness is common "
            "to all other joints, and one on the damping",
            "shares are of the variance of ln utilisation, which is finite where life is not",
            *notes,
            *model.without_load(),
        ),
        seed=seed,
        lives=drawn.robots_life.ravel(),
        intervals=sampler.intervals(drawn),
    )


# Samples before a narrow interval is believed.
_FEWEST = 512


@dataclass(frozen=True)
class _Input:
    """One thing that varies.

    Attributes:
        name: as results call it.
        uncertain: its distribution.
        source: where its spread is from.
        key: "stiffness", "damping_ratio" or "radius" of joints, or what is varied as a whole.
        joints: the flexible joints whose key it is; empty for what has no joint.
        spread: a value that needs another robot; None otherwise.
        estimated: an estimate without a stated spread.
    """

    name: str
    uncertain: Uncertain
    source: str
    key: str
    joints: tuple[int, ...] = ()
    spread: Spread | None = None
    estimated: bool = False


_OF_A_JOINT = {("stiffness",): "stiffness", ("damping_ratio",): "damping_ratio",
               ("shaft", "radius"): "radius"}  # fmt: skip


def _inputs_of(
    model: Model,
    task: Task,
    stress: ShaftStress,
    given: Mapping[str, Uncertain] | None,
    notes: list[str],
) -> tuple[_Input, ...]:
    """What varies: what is asked for, what the robot's files state, and the curves' scatter."""
    robot = model.robot
    default = default_inputs(task)
    asked = dict(default if given is None else given)

    def source(name: str) -> str:
        same = asked.get(name) == DEFAULT_INPUTS.get(name)
        return "picchio's default" if same else "as asked for"

    said = {name: source(name) for name in asked}
    if "width" not in asked and "width" not in default:
        notes.append("blows that state no width keep theirs")
    own = dict(robot.spreads)
    for joint in robot.flexible_joints:
        for key in ("stiffness", "damping_ratio"):
            each = Spread("joint", joint.name, (key,), getattr(joint, key), 0.0, True)
            if each.name in asked:
                own.setdefault(each.name, each)
    found = []
    taken: dict[str, set[int]] = {"stiffness": set(), "damping_ratio": set()}
    index = {joint.name: j for j, joint in enumerate(robot.flexible_joints)}
    for name, spread in own.items():
        shape = "lognormal" if spread.log else "absolute"
        middle = 1.0
        if not spread.log:
            value = spread.value
            middle = value[spread.component or 0] if isinstance(value, tuple) else value
        uncertain = Uncertain(middle, spread.size, shape)  # type: ignore[arg-type]
        replaced = asked.pop(name, None)
        told = replaced or uncertain
        part = _OF_A_JOINT.get(spread.path) if spread.table == "joint" else None
        where = said[name] if replaced else spread.source
        guess = spread.estimated and replaced is None
        if part is None:
            found.append(_Input(name, told, where, name, (), spread, guess))
            continue
        taken.setdefault(part, set()).add(index[spread.owner])
        found.append(_Input(name, told, where, part, (index[spread.owner],), None, guess))
    for name, uncertain in asked.items():
        if name not in DEFAULT_INPUTS:
            choices = [*DEFAULT_INPUTS, *own, *(f"stiffness.{j}" for j in index)]
            raise InputError("unknown input", key="inputs", value=name,
                             choices=dict.fromkeys(choices))  # fmt: skip
        others = tuple(j for j in index.values() if j not in taken.get(name, ()))
        if name in taken:
            if not others:
                continue
            found.append(_Input(name, uncertain, said[name], name, others))
        else:
            found.append(_Input(name, uncertain, said[name], name))
    if any(curve.scatter for curve in stress.curves):
        # A rank: ln of it is the specimen's standard normal score; each curve has its scatter.
        found.append(
            _Input("strength", Uncertain(1.0, 1.0), "scatter of the S-N curves", "strength")
        )
    return tuple(found)


class Drawn(NamedTuple):
    """What drawn worlds do to a robot: k joints with shafts, n flexible ones, m worlds.

    Attributes:
        lives: (k, m) rivets of the mix to failure.
        used: (k, m) fatigue utilisation.
        yielding: (k, m) largest stress, gravity and blows together, over the static strength in
            shear; NaN where that is not known.
        peak: (n, m) N m (N), largest magnitude of gravity and blows together.
        geared: (n, m) torque over the reducer's limit that binds; NaN without a reducer.
    """

    lives: FloatArray
    used: FloatArray
    yielding: FloatArray
    peak: FloatArray
    geared: FloatArray

    @classmethod
    def joined(cls, parts: Sequence[Drawn], axis: int = 1) -> Drawn:
        """Several of them as one.

        Args:
            parts: each with the same joints.
            axis: of the worlds.
        """
        return cls(*(np.concatenate(column, axis=axis) for column in zip(*parts, strict=True)))

    @property
    def robots_life(self) -> FloatArray:
        """(m,) of the weakest joint; infinite without a shaft."""
        return np.asarray(self.lives.min(axis=0, initial=np.inf))

    @property
    def robots_use(self) -> FloatArray:
        """(m,) of the most used shaft; without one, of the reducer."""
        if len(self.used):
            return np.asarray(self.used.max(axis=0))
        return np.asarray(np.nanmax(self.geared, axis=0))

    def holds(self, rivets: float) -> FloatArray:
        """(m,) whether every part holds for a life.

        Args:
            rivets: the life, of the task's mix.
        """
        over = (self.lives < rivets).any(axis=0) | (self.yielding > 1.0).any(axis=0)
        return np.asarray(~(over | (self.geared > 1.0).any(axis=0)))


def interval(values: FloatArray) -> tuple[float, float]:
    """P10 and P90 of drawn values.

    Args:
        values: any shape, infinite ones included.

    Returns:
        the two, each a value that was drawn.
    """
    low, high = np.quantile(values, [0.1, 0.9], method="inverted_cdf")
    return float(low), float(high)


@dataclass(frozen=True)
class _Sampler:
    """Lives of the sampled worlds.

    Attributes:
        model: the robot and its effects, as stated.
        task: its work.
        stress: the joints that count.
        inputs: what varies.
    """

    model: Model
    task: Task
    stress: ShaftStress
    inputs: tuple[_Input, ...]

    @classmethod
    def of(
        cls,
        model: Model,
        task: Task,
        stress: ShaftStress,
        given: Mapping[str, Uncertain] | None,
        notes: list[str],
    ) -> _Sampler:
        """With every input that has an effect; arguments as of `_inputs_of`."""
        sampler = cls(model, task, stress, _inputs_of(model, task, stress, given, notes))
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
    def _rebuilt(self) -> bool:
        return any(each.spread is not None for each in self.inputs)

    @property
    def budget(self) -> int:
        """Samples at most, by what one takes: micro-, tenths of or whole milliseconds a place."""
        if not self._modal or (self._rebuilt and not self._plain):
            return 256
        return 16_384 if self._plain and not self._rebuilt else 2_048 if self._plain else 512

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
        strength = [c.yield_shear or c.ultimate_shear or np.nan for c in self.stress.curves]
        per = stress_per_torque(self.stress.joints) / np.array(strength)
        yielding = peak[self._columns] * per[:, None] * draw.thinner.T
        # Each limit of a reducer is for one of the two, so their largest values give its share.
        geared = np.full_like(peak, np.nan)
        for row, joint in enumerate(self.model.robot.flexible_joints):
            if joint.reducer is not None:
                shares = joint.reducer.shares(peak[row], held[row])
                geared[row] = np.max(list(shares.values()), axis=0)
        return Drawn(lives, used, yielding, peak, geared)

    @property
    def _columns(self) -> IndexArray:
        return np.array(self.stress.columns, dtype=np.int64)

    def intervals(self, drawn: Drawn) -> dict[str, dict[str, tuple[float, float]]]:
        """P10 and P90 of what each flexible joint's parts bear.

        Args:
            drawn: worlds, in one or more dimensions.
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
        from picchio.studies.rivet.damage_kernel import damages

        m, p = draw.count, len(op.poses)
        worlds = [nominal]
        if self._rebuilt:
            models = (replace(self.model, robot=draw.robot(d)) for d in range(m))
            worlds = [ManyPoses(model, op.poses) for model in models]
        matrices = [world.mass_and_jacobian() for world in worlds]
        mass = np.concatenate([mass for mass, _ in matrices])
        jacobian = np.concatenate([jacobian for _, jacobian in matrices])
        springs = np.concatenate([world.stiffness for world in worlds])
        static = -np.concatenate([world.gravity_torque() for world in worlds])
        if op.excitation.preload:
            static = static + op.excitation.preload * np.einsum("pdn,d->pn", jacobian, op.direction)
        ratio = np.array([world.damping_ratio for world in worlds])
        d, place = np.repeat(np.arange(m), p), np.tile(np.arange(p), m)
        world = d if self._rebuilt else np.zeros_like(d)
        place = place + p * world
        forces = draw.forces(op)
        curves: list[SNCurve | None] = [None] * springs.shape[1]
        for column, curve in zip(self.stress.columns, self.stress.curves, strict=True):
            curves[column] = curve
        factor = np.zeros((m, springs.shape[1]))
        columns = self._columns
        factor[:, columns] = stress_per_torque(self.stress.joints) * draw.load
        frequency, low, high, damaged = np.empty((4, m * p, springs.shape[1]))
        stiffness = springs[place] * draw.stiffness[d]
        damages(
            *stacked(forces), mass, jacobian, d if len(forces) > 1 else np.zeros_like(d), place,
            stiffness, ratio[world] * draw.damping[d], np.tile(op.direction, (len(mass), 1)),
            factor[d], *curve_tables(curves), frequency, low, high, damaged,
        )  # fmt: skip
        allowable = np.array([curve.allowable for curve in self.stress.curves])
        loaded = 0.5 * (stiffness * (high - low) * factor[d])[:, columns] / allowable
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
            assert joint.shaft is not None
            rest, stiffness, static = loads[column]
            cycles = rainflow(
                shear_stress(stiffness * rest, joint.shaft), residue=self.stress.residue
            )
            factor = draw.load[d, k]
            steady = float(shear_stress(static, joint.shaft)) * draw.thinner[d, k]
            load = Cycles.trusted(
                factor * cycles.range, factor * cycles.mean + steady, cycles.count
            )
            curve, rule = self.stress.curves[k], self.stress.mean_stress
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
        """The stiffnesses along which the robot's life turns."""
        found = {}
        score = np.linspace(-2.0, 2.0, _SCAN)
        for i, each in enumerate(self.inputs):
            if each.key != "stiffness":
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
        thinner: (m, k) factors on the stress of the joints that count, by their shafts' radii.
        vibration: (m,) all factors on the torques of the vibration.
        load: (m, k) all factors on the stress of the vibration, strength included.
        width: (m,) factors on the blows' width.
        force: (m,) factors on the blows' force, where that is not a factor on the stress.
        others: spreads of values that need another robot, and their (m,) scores.
    """

    sampler: _Sampler
    stiffness: FloatArray
    damping: FloatArray
    thinner: FloatArray
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
    def of(cls, sampler: _Sampler, moved: FloatArray, further: FloatArray) -> _Draw:
        """From normal scores (m, inputs), and further factors (m,) on a linear vibration."""
        m, n = len(moved), len(sampler.model.robot.flexible_joints)
        of_joints = {key: np.ones((m, n)) for key in ("stiffness", "damping_ratio", "radius")}
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
        thinner = of_joints["radius"][:, sampler._columns] ** -3.0
        score = np.log(whole["strength"])
        strength = np.array([_strength(curve, score) for curve in stress.curves]).reshape(-1, m).T
        # Only of a linear model is the load proportional to the force.
        force, vibration = whole["force"], whole["model"] * further
        if not sampler.model.nonlinear:
            vibration, force = vibration * force, np.ones(m)
        load = vibration[:, None] * thinner / strength
        return cls(sampler, of_joints["stiffness"], of_joints["damping_ratio"], thinner, vibration,
                   load, whole["width"], force, others)  # fmt: skip

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

            many = sampler._places[which]
            mass, jacobian = many.mass_and_jacobian()
            stiffness = many.stiffness[i] * self.stiffness[d]
            force = sampler.model.force(self.blows(d, op).excitation, op.hits_per_rivet)
            burst = [part[0] for part in stacked([force])]
            turns, count = swing(
                mass[i], jacobian[i], stiffness, many.damping_ratio * self.damping[d],
                op.direction, np.full(len(stiffness), -1.0), burst[0], burst[1], burst[2],
                burst[3], burst[4], np.empty(len(stiffness)),
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
        # Factors go onto the springs as the effects leave them.
        effects = [
            JointStiffness(joint.name, scale=float(factor))
            for joint, factor in zip(joints, self.stiffness[d], strict=True)
            if factor != 1.0
        ]
        varied = replace(model, robot=replace(robot, flexible_joints=joints))
        return replace(varied, effects=(*model.effects, *effects)) if effects else varied


class Cases:
    """The drawn cases of a robot at work, the same ones for every question asked of them.

    Args:
        model: the robot, whose values have spreads, and its effects.
        task: its work.
        stress: the joints with shafts; a curve without scatter does not vary.
    """

    def __init__(self, model: Model, task: Task, stress: ShaftStress) -> None:
        self._sampler = _Sampler.of(model, task, stress, None, [])
        names = [each.name for each in self._sampler.inputs]
        draws = Draws(len(names))
        while draws.scores.shape[0] * draws.scores.shape[1] < _FEW:
            draws.more()
        self._moved = draws.scores.reshape(-1, len(names)) @ root_of(names, model.robot.posterior)

    @property
    def cheap(self) -> bool:
        """Whether many questions take seconds: compiled code answers, of one robot."""
        sampler = self._sampler
        return sampler._modal and sampler._plain and not sampler._rebuilt

    @cached_property
    def drawn(self) -> Drawn:
        """What they do as the task is."""
        return self._sampler.run(self._moved)

    @cached_property
    def intervals(self) -> dict[str, dict[str, tuple[float, float]]]:
        """As of `UncertainLife`."""
        return self._sampler.intervals(self.drawn)

    def at(self, task: Task, every: int = 4) -> Drawn:
        """What some of the cases do at another task, with the same model.

        Args:
            task: with blows that state a width where the first one's do.
            every: so-manyth case; 1 for all.
        """
        return replace(self._sampler, task=task).run(self._moved[::every])

    def force_factor(self, rivets: float, near: float) -> FloatArray:
        """(m,) the largest factor on the force at which every part holds, of a linear model.

        Halved within a factor of 20 about `near`, to 0.3 % from the safe side; 0 or inf beyond.

        Args:
            rivets: the life for which it must hold.
            near: about where to look.
        """
        low, high = np.full((2, len(self._moved)), math.log(near))
        low, high = low - _WIDE, high + _WIDE

        def holds(log: FloatArray) -> np.ndarray[Any, Any]:
            return self._sampler.run(self._moved, np.exp(log)).holds(rivets)

        never, always = ~holds(low), holds(high)
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            fine = holds(middle)
            low, high = np.where(fine, middle, low), np.where(fine, high, middle)
        return np.where(never, 0.0, np.where(always, np.inf, np.exp(low)))


# Cases of a question; how far a force is looked for, as a logarithm, and how often it is halved.
_FEW, _WIDE, _HALVINGS = 256, math.log(20.0), 11


def _strength(curve: SNCurve, score: FloatArray) -> FloatArray:
    """Specimens' strength over the curve's: 1 where the curve has no scatter."""
    if curve.survival is None or not curve.scatter:
        return np.ones_like(score)
    return np.asarray(10.0 ** (curve.scatter * (score + NormalDist().inv_cdf(curve.survival))))
