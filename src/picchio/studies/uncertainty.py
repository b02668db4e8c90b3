"""How sure a life is: stiffness, damping, blows, strength and the model itself as distributions."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from statistics import NormalDist
from typing import TYPE_CHECKING, Any

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.excitation.excitation import Excitation
from picchio.excitation.half_sine_train import HalfSineTrain
from picchio.excitation.piecewise import PiecewiseForce
from picchio.excitation.pulse_train import PulseTrain
from picchio.fatigue.counting.counter import Residue
from picchio.fatigue.counting.cycles import Cycles
from picchio.fatigue.mean_stress import Rule
from picchio.fatigue.miner import damage, life, utilisation
from picchio.fatigue.sn.curve import SNCurve
from picchio.fatigue.uncertain_lives import LifeSpread, Uncertain, design
from picchio.model.model import Model
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.joint import Joint
from picchio.studies.rivet.loads import Rivet
from picchio.studies.tasks import Operation, Task
from picchio.vibration.closed_form.modes import modal_analysis

if TYPE_CHECKING:
    from picchio.studies.rivet.fast_rest import FastRest


# A rivet's stress cycles under perturbed stiffness, damping and blows; see `uncertainty`.

_DYNAMIC = ("stiffness", "damping_ratio", "width")


@dataclass(frozen=True, eq=False)
class Place(Rivet):
    """One pose of one operation, ready to be perturbed.

    Attributes:
        rivets: set there in a pass of the task.
    """

    rivets: float = 1.0

    @cached_property
    def fast(self) -> FastRest | None:
        """The compiled path; None where the modes need the exact one."""
        from picchio.studies.rivet.fast_rest import FastRest

        modes = modal_analysis(self.system)
        return FastRest(modes, self.direction) if FastRest.suits(modes) else None


@dataclass(frozen=True)
class LifeJob:
    """The joints that count, and how their stress becomes damage."""

    joints: list[Joint]
    columns: list[int]
    curves: list[SNCurve]
    residue: Residue
    mean_stress: Rule

    def cycles(
        self,
        place: Place,
        stiffness: float,
        damping: float,
        width: float,
        *,
        compiled: bool = False,
    ) -> list[tuple[Cycles, float]]:
        """Each joint's stress cycles at nominal force, Pa, and its steady stress.

        Args:
            place: pose and blows.
            stiffness: factor on all stiffnesses.
            damping: factor on all damping ratios.
            width: factor on the width of the blows.
            compiled: turning points to 1e-7, many times faster than those of `loads_at`.
        """
        blows, turns = _wider(place.excitation, width), None
        if compiled and place.fast is not None:
            turns = place.fast.turns(stiffness, damping, _burst(blows, place.hits))
        if turns is None:
            rivet = place.perturbed(stiffness, damping, blows)
            loads = rivet.loads(need="rest", both=False)
        else:
            loads = place.joint_loads(turns, stiffness=stiffness * place.stiffness)
        return [
            (loads[column].stress_cycles(joint, self.residue), loads[column].static_stress(joint))
            for joint, column in zip(self.joints, self.columns, strict=True)
        ]

    def _per_pass(
        self, places: list[Place], factors: tuple[float, ...]
    ) -> list[tuple[Cycles, FloatArray]]:
        """Each joint's cycles of all places, counted as often as rivets are set there.

        Beside them the steady stress under each cycle, Pa.
        """
        found = [self.cycles(place, *factors, compiled=True) for place in places]
        joined = []
        for k in range(len(self.joints)):
            parts = [pose[k] for pose in found]
            counts = [c.count * p.rivets for (c, _), p in zip(parts, places, strict=True)]
            joined.append(
                (
                    Cycles.trusted(
                        np.concatenate([cycles.range for cycles, _ in parts]),
                        np.concatenate([cycles.mean for cycles, _ in parts]),
                        np.concatenate(counts),
                    ),
                    np.concatenate([np.full(len(cycles), steady) for cycles, steady in parts]),
                )
            )
        return joined

    def spend(
        self, k: int, cycles: Cycles, steady: float | FloatArray, factor: float
    ) -> tuple[float, float]:
        """Damage and utilisation of joint k with its stress times `factor`."""
        load = Cycles.trusted(factor * cycles.range, factor * cycles.mean + steady, cycles.count)
        return (
            damage(load, self.curves[k], self.mean_stress),
            utilisation(load, self.curves[k], self.mean_stress),
        )

    def worst(
        self, places: list[Place], blocks: list[int], keep: int
    ) -> tuple[list[int], FloatArray]:
        """Indices of the most strained poses, and each joint's share of damage elsewhere.

        The share is a factor, 1 or more, on the damage of the poses that are kept.
        """
        found = [self.cycles(place, 1.0, 1.0, 1.0, compiled=True) for place in places]
        spent = np.array([[self.spend(k, *p, 1.0) for k, p in enumerate(pose)] for pose in found])
        rivets = np.array([place.rivets for place in places])
        kept: set[int] = set()
        start = 0
        for block in blocks:
            order = np.argsort(-spent[start : start + block, :, 1], axis=0)
            kept |= {start + int(i) for i in order[:keep].ravel()}
            start += block
        index = sorted(kept)
        whole = rivets @ spent[:, :, 0]
        part = rivets[index] @ spent[index, :, 0]
        return index, np.where(part > 0, whole / np.where(part > 0, part, 1.0), 1.0)

    def run(
        self,
        places: list[Place],
        kept: list[int],
        left_out: FloatArray,
        values: Mapping[str, FloatArray],
        progress: Callable[[int, int], None] | None,
    ) -> tuple[FloatArray, FloatArray]:
        """Passes of the task to failure, and utilisation, each (n_joints, m)."""
        runs = len(next(iter(values.values())))
        columns = {name: values.get(name, np.ones(runs)) for name in (*_DYNAMIC, "force", "model")}
        score = np.log(values["strength"]) if "strength" in values else np.zeros(runs)
        lives = np.empty((len(self.joints), runs))
        used = np.empty_like(lives)
        known: dict[tuple[float, ...], list[tuple[Cycles, FloatArray]]] = {}
        for m in range(runs):
            key = tuple(float(columns[name][m]) for name in _DYNAMIC)
            if key not in known:
                known[key] = self._per_pass([places[i] for i in kept], key)
            load = columns["force"][m] * columns["model"][m]
            for k, curve in enumerate(self.curves):
                factor = float(load / _strength(curve, score[m]))
                cycles, steady = known[key][k]
                spent, used[k, m] = self.spend(k, cycles, steady, factor)
                lives[k, m] = life(spent * left_out[k])
            if progress is not None:
                progress(m + 1, runs)
        return lives, used


def _strength(curve: SNCurve, score: float) -> float:
    """A specimen's strength over the curve's: 1 where the curve has no scatter."""
    if curve.survival is None or not curve.scatter:
        return 1.0
    return float(10.0 ** (curve.scatter * (score + NormalDist().inv_cdf(curve.survival))))


def place_of(model: Model, operation: Operation, pose: FloatArray) -> Place:
    """A pose of an operation, ready to be perturbed."""
    return Place.at(model, operation, model.robot.state(pose), pose, rivets=operation.rivets)


@lru_cache(maxsize=256)
def _burst(excitation: Excitation, hits: int) -> PiecewiseForce:
    """The blows as a force history: the same for many poses."""
    return excitation.burst(hits)


def _wider(excitation: Excitation, factor: float) -> Excitation:
    if factor == 1.0:
        return excitation
    if isinstance(excitation, PulseTrain | HalfSineTrain):
        width = min(excitation.width * factor, 0.999 * excitation.period)
        return dataclasses.replace(excitation, width=width)
    raise InputError("these blows have no width to vary", key="inputs.width")


# Relative, as the campaign's tolerances; the width and the model's error are judgements.
DEFAULT_INPUTS: dict[str, Uncertain] = {
    "stiffness": Uncertain(1.0, 0.05),
    "damping_ratio": Uncertain(1.0, 0.20),
    "force": Uncertain(1.0, 0.05),
    "width": Uncertain(1.0, 0.05),
    "model": Uncertain(1.0, 0.10),
}


@dataclass(frozen=True)
class UncertainLife:
    """Lives as distributions.

    Attributes:
        joints: of each joint with a shaft, rivets of the task's mix.
        robot: of the weakest joint, sample by sample.
        inputs: what was varied: factors on the nominal values; of "strength", ln is the
            specimens' standard normal score, which each curve's own scatter multiplies.
        assumptions: what was taken for granted.
        seed: of the samples.
    """

    joints: dict[str, LifeSpread]
    robot: LifeSpread
    inputs: dict[str, Uncertain]
    assumptions: tuple[str, ...]
    seed: int

    def _repr_html_(self) -> str:
        from picchio.core.html import sheet
        from picchio.studies.assessment.result import format_count

        rows = [
            (name, *map(format_count, (s.p10, s.p50, s.p90)), 100 * s.endless)
            for name, s in {**self.joints, "robot": self.robot}.items()
        ]
        columns = ("rivets to failure", "P10", "P50", "P90", "without end [%]")
        return sheet("How sure the life is", {"varied": ", ".join(self.inputs)}, columns, rows)

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "joints": {name: spread.to_dict() for name, spread in self.joints.items()},
            "robot": self.robot.to_dict(),
            "inputs": {name: dataclasses.asdict(value) for name, value in self.inputs.items()},
            "assumptions": list(self.assumptions),
            "seed": self.seed,
        }


def uncertain_life(
    robot: FlexibleRobot,
    task: Task,
    curves: Mapping[str, SNCurve],
    *,
    inputs: Mapping[str, Uncertain] = DEFAULT_INPUTS,
    samples: int = 64,
    seed: int = 0,
    poses: int = 2,
    residue: Residue = "half-cycles",
    mean_stress: Rule = "none",
    gravity_balanced: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> UncertainLife:
    """P10, P50 and P90 of every joint's life, and what makes them uncertain.

    Rivets start from rest and ring down, cycles are counted by rainflow (`assess`'s default). A
    factor on the stiffness is common to all joints. Specimens' strength scatters as each curve
    says, one rank for all joints; a curve without scatter counts as certain.

    Args:
        robot: with shafts.
        task: what it does.
        curves: S-N curve of each joint that counts, by joint name.
        inputs: factors on the nominal values, by name: "stiffness", "damping_ratio", "force",
            "width" (of the blows), "model" (error of the computed stress).
        samples: a power of two; the dynamics run about five times as often.
        seed: the same seed gives the same result.
        poses: how many poses of each operation and joint are sampled, the most strained ones; the
            rest keep their nominal share of the damage.
        residue: as in `assess`.
        mean_stress: as in `assess`.
        gravity_balanced: as in `assess`.
        progress: called with (runs done, runs in all).

    Raises:
        InputError: no joint with shaft and curve, an unknown input, a width where blows have none.
    """
    joints = [j for j in robot.flexible_joints if j.shaft is not None and j.name in curves]
    if not joints:
        raise InputError("no joint has a shaft and an S-N curve", key="curves")
    for name in inputs:
        if name not in DEFAULT_INPUTS:
            raise InputError("unknown input", key="inputs", value=name, choices=DEFAULT_INPUTS)
    columns = [robot.flexible_names.index(joint.name) for joint in joints]
    job = LifeJob(joints, columns, [curves[j.name] for j in joints], residue, mean_stress)
    model = Model(robot, gravity_balanced=gravity_balanced)
    places = [place_of(model, op, pose) for op in task.operations for pose in op.poses]
    kept, left_out = job.worst(places, [len(op.poses) for op in task.operations], poses)
    varied = dict(inputs)
    if any(curve.scatter for curve in job.curves):
        # A rank: ln of it is the specimen's standard normal score; each curve has its scatter.
        varied["strength"] = Uncertain(1.0, 1.0)
    plan = design(varied, samples=samples, seed=seed)
    lives, used = job.run(places, kept, left_out, plan.values, progress)
    lives *= task.rivets_per_pass
    spreads = {
        joint.name: plan.summarise(lives[k], used[k])
        for k, joint in enumerate(joints)
        if (used[k] > 0).all()
    }
    return UncertainLife(
        joints=spreads,
        robot=plan.summarise(lives.min(axis=0), used.max(axis=0)),
        inputs=varied,
        assumptions=(
            "inputs vary independently; a factor on the stiffness is common to all joints",
            f"{len(kept)} of {len(places)} poses sampled, the most strained; the rest keep their "
            "nominal share of the damage",
            "shares are of the variance of ln utilisation, which is finite where life is not",
        ),
        seed=seed,
    )
