"""A rivet's stress cycles under perturbed stiffness, damping and blows; see `uncertainty`."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.excitation import Excitation, HalfSineTrain, PulseTrain
from picchio.fatigue import Cycles, SNCurve, damage, life, rainflow, shear_stress, utilisation
from picchio.fatigue.mean_stress import Rule
from picchio.fatigue.rainflow import Residue
from picchio.model import LinearSystem, Model
from picchio.robot import Joint
from picchio.studies.task import Operation
from picchio.vibration import modal_analysis, response_from_rest

_DYNAMIC = ("stiffness", "damping_ratio", "width")


@dataclass(frozen=True)
class Place:
    """One pose of one operation, ready to be perturbed."""

    system: LinearSystem
    excitation: Excitation
    direction: FloatArray
    hits: int
    rivets: float
    stiffness: FloatArray
    static_torque: FloatArray


@dataclass(frozen=True)
class LifeJob:
    """The joints that count, and how their stress becomes damage."""

    joints: list[Joint]
    columns: list[int]
    curves: list[SNCurve]
    residue: Residue
    mean_stress: Rule

    def cycles(
        self, place: Place, stiffness: float, damping: float, width: float
    ) -> list[tuple[Cycles, float]]:
        """Each joint's stress cycles at nominal force, Pa, and its steady stress."""
        system = place.system
        perturbed = dataclasses.replace(
            system,
            stiffness_matrix=stiffness * system.stiffness_matrix,
            # Modal damping with the same mode shapes: C goes with zeta omega.
            damping_matrix=damping * math.sqrt(stiffness) * system.damping_matrix,
        )
        response = response_from_rest(
            modal_analysis(perturbed), _wider(place.excitation, width), place.hits
        )
        points = response.turning_points(place.direction)
        found = []
        for joint, column in zip(self.joints, self.columns, strict=True):
            assert joint.shaft is not None
            spring = stiffness * place.stiffness[column]
            stress = shear_stress(spring * points[column][1], joint.shaft)
            steady = float(shear_stress(place.static_torque[column], joint.shaft))
            found.append((rainflow(stress, self.residue), steady))
        return found

    def spend(self, k: int, cycles: Cycles, steady: float, factor: float) -> tuple[float, float]:
        """Damage and utilisation of joint k with its stress times `factor`."""
        load = cycles.scaled(factor).shifted(steady)
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
        spent = np.array(
            [
                [self.spend(k, *pair, 1.0) for k, pair in enumerate(self.cycles(p, 1.0, 1.0, 1.0))]
                for p in places
            ]
        )
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
        known: dict[tuple[float, ...], list[list[tuple[Cycles, float]]]] = {}
        for m in range(runs):
            key = tuple(float(columns[name][m]) for name in _DYNAMIC)
            if key not in known:
                known[key] = [self.cycles(places[i], *key) for i in kept]
            load = columns["force"][m] * columns["model"][m]
            for k, curve in enumerate(self.curves):
                factor = float(load / _strength(curve, score[m]))
                spent = [self.spend(k, *pose[k], factor) for pose in known[key]]
                per_pass = sum(places[i].rivets * d for i, (d, _) in zip(kept, spent, strict=True))
                lives[k, m] = life(per_pass * left_out[k])
                used[k, m] = max(u for _, u in spent)
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
    state = model.robot.state(pose)
    feed = operation.excitation.preload * (state.jacobian.T @ operation.direction)
    return Place(
        system=model.linear_system(pose),
        excitation=operation.excitation,
        direction=operation.direction,
        hits=operation.hits_per_rivet,
        rivets=operation.rivets,
        stiffness=state.stiffness,
        static_torque=feed - model.holding_torque(state),
    )


def _wider(excitation: Excitation, factor: float) -> Excitation:
    if factor == 1.0:
        return excitation
    if isinstance(excitation, PulseTrain | HalfSineTrain):
        width = min(excitation.width * factor, 0.999 * excitation.period)
        return dataclasses.replace(excitation, width=width)
    raise InputError("these blows have no width to vary", key="inputs.width")
