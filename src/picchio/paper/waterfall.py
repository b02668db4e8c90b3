"""The life of the paper's task by its method, with each correction alone, and with all."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.fatigue.counting.counter import rainflow
from picchio.fatigue.counting.cycles import Cycles
from picchio.fatigue.miner import damage, life
from picchio.fatigue.sn.curve import SNCurve
from picchio.fatigue.sn.library import load_sn_curve
from picchio.paper.fourier import worst_responses
from picchio.paper.statics import gravity_stress
from picchio.paper.world import World
from picchio.studies.rivet.pose import JointLoad, Rivet

STEEL = "42CrMo4-QT-shaft"
"""An ordinary shaft steel to compare the paper's curve with."""
CORRECTIONS = ("transient", "counting", "gravity", "curve")
WORDS = {
    "transient": "from rest, not steady",
    "counting": "cycles counted, not one a hit",
    "gravity": "gravity as a mean stress (FKM)",
    "curve": f"{STEEL}, its endurance limit",
}


@dataclass(frozen=True)
class Step:
    """The life with some of the corrections.

    Attributes:
        name: in words.
        corrections: which.
        rivets: to failure; inf where nothing fails.
        joint: index of the joint that fails first; -1 where none does.
        without_limit: the life if the curve had no endurance limit, so that it is finite.
    """

    name: str
    corrections: tuple[str, ...]
    rivets: float
    joint: int
    without_limit: float

    def to_dict(self) -> dict[str, Any]:
        """For JSON; an infinite life is None."""
        return {
            "name": self.name,
            "corrections": self.corrections,
            "rivets_to_failure": self.rivets,
            "limiting_joint": f"joint_{self.joint + 1}" if self.joint >= 0 else None,
            "without_endurance_limit": self.without_limit,
        }


@dataclass(frozen=True, eq=False)
class _Loads:
    world: World
    poses: list[tuple[JointLoad, ...]]
    gravity: FloatArray
    hits: int

    @property
    def torque_factor(self) -> float:
        return self.world.given.stress_per_twist


def _loads(world: World) -> _Loads:
    poses = [
        Rivet(world.model, operation, pose).loads()
        for operation in world.operations()
        for pose in operation.poses
    ]
    gravity = np.tile(1e6 * gravity_stress(world), (3, 1))
    return _Loads(world, poses, gravity, world.printed.task.hits_per_rivet)


def waterfall(world: World) -> tuple[Step, ...]:
    """The life by the paper's method, by each correction alone, and by all together."""
    loads = _loads(world)
    steel = load_sn_curve(STEEL, quiet=True)
    paper = world.printed.sn_curve.sn_curve(steel.tensile_strength)
    sets: list[tuple[str, tuple[str, ...]]] = [("the paper's method", ())]
    sets += [(WORDS[name], (name,)) for name in CORRECTIONS]
    sets += [("all four", CORRECTIONS)]
    steps = []
    for name, chosen in sets:
        curve = steel if "curve" in chosen else paper
        rivets, joint = _weakest(_lives(loads, chosen, curve))
        endless = dataclasses.replace(curve, miner="elementary") if curve.knees else curve
        steps.append(
            Step(name, chosen, rivets, joint, float(np.min(_lives(loads, chosen, endless))))
        )
    return tuple(steps)


def paper_lives(world: World) -> FloatArray:
    """(3,) rivets to failure of each joint by the paper's own method, Miner over all rivets."""
    cycles = world.printed.sn_curve.cycles(world.rivet_stress)
    spent = (world.printed.task.hits_per_rivet / cycles).mean(axis=(0, 1))
    return np.array([life(float(d)) for d in spent])


def peak_over_amplitude(world: World) -> float:
    """Peak of the steady state over half its range, at the world's largest stress."""
    _, steady, n, joint = worst_responses(world, world.printed.task.hits_per_rivet)
    value = steady.turning_points(n)[joint][1]
    return float(np.abs(value).max() / (0.5 * np.ptp(value)))


def _weakest(lives: FloatArray) -> tuple[float, int]:
    joint = int(np.argmin(lives))
    return float(lives[joint]), joint if math.isfinite(lives[joint]) else -1


def _lives(loads: _Loads, chosen: tuple[str, ...], curve: SNCurve) -> FloatArray:
    """(3,) rivets to failure: the rivets of the task in turn."""
    spent = np.zeros(3)
    for pose, gravity in zip(loads.poses, loads.gravity, strict=True):
        for j in range(3):
            cycles = _cycles(loads, pose, j, chosen)
            rule = "none"
            if "gravity" in chosen:
                cycles, rule = cycles.shifted(float(gravity[j])), "fkm"
            spent[j] += damage(cycles, curve, rule)  # type: ignore[arg-type]
    return np.array([life(float(d) / len(loads.poses)) for d in spent])


def _cycles(
    loads: _Loads, pose: tuple[JointLoad, ...], joint: int, chosen: tuple[str, ...]
) -> Cycles:
    """Stress cycles of one rivet, Pa, about their own mean."""
    load = pose[joint]
    points = load.rest if "transient" in chosen else load.steady
    assert points is not None
    stress = loads.torque_factor * points
    if "counting" not in chosen:
        peak = float(np.abs(stress).max())
        return Cycles(np.array([2.0 * peak]), np.zeros(1), np.array([float(loads.hits)]))
    if "transient" in chosen:
        return rainflow(stress)
    return rainflow(stress).repeated(loads.hits)
