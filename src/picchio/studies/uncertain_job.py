"""A rivet's stress cycles under perturbed stiffness, damping and blows; see `uncertainty`."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from statistics import NormalDist
from typing import TYPE_CHECKING

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.excitation import Excitation, HalfSineTrain, PiecewiseForce, PulseTrain
from picchio.fatigue import Cycles, SNCurve, damage, life, utilisation
from picchio.fatigue.mean_stress import Rule
from picchio.fatigue.rainflow import Residue
from picchio.model import Model
from picchio.robot import Joint
from picchio.studies.loads import Rivet
from picchio.studies.task import Operation
from picchio.vibration import modal_analysis

if TYPE_CHECKING:
    from picchio.studies.fast_rest import FastRest

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
        from picchio.studies.fast_rest import FastRest

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
