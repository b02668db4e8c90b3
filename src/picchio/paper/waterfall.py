"""The life of the paper's task by its method, with each correction alone, and with all."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.fatigue.counting.counter import rainflow
from picchio.fatigue.counting.cycles import Cycles
from picchio.fatigue.mean_stress import Rule
from picchio.fatigue.miner import damage, life
from picchio.fatigue.sn.curve import SNCurve
from picchio.fatigue.sn.library import load_sn_curve
from picchio.paper.fourier import worst_responses
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


def waterfall(world: World) -> tuple[Step, ...]:
    """The life by the paper's method, by each correction alone, and by all together."""
    rivets = [
        Rivet(world.model, operation, pose).loads()
        for operation in world.operations()
        for pose in operation.poses
    ]
    gravity = np.tile(1e6 * world.gravity_stress, (3, 1))
    steel = load_sn_curve(STEEL, quiet=True)
    paper = world.printed.sn_curve.sn_curve(steel.tensile_strength)

    def lives(chosen: tuple[str, ...], curve: SNCurve) -> FloatArray:
        """(3,) rivets to failure: the rivets of the task in turn."""
        rule: Rule = "fkm" if "gravity" in chosen else "none"
        spent = np.zeros(3)
        for loads, means in zip(rivets, gravity, strict=True):
            for j, load in enumerate(loads):
                cycles = _cycles(world, load, chosen)
                if rule == "fkm":
                    cycles = cycles.shifted(float(means[j]))
                spent[j] += damage(cycles, curve, rule)
        return np.array([life(float(d) / len(rivets)) for d in spent])

    sets: dict[str, tuple[str, ...]] = {
        "the paper's method": (),
        **{WORDS[name]: (name,) for name in CORRECTIONS},
        "all four": CORRECTIONS,
    }
    steps = []
    for name, chosen in sets.items():
        curve = steel if "curve" in chosen else paper
        found = lives(chosen, curve)
        joint = int(np.argmin(found)) if np.isfinite(found).any() else -1
        endless = dataclasses.replace(curve, miner="elementary") if curve.knees else curve
        least = float(lives(chosen, endless).min())
        steps.append(Step(name, chosen, float(found.min()), joint, least))
    return tuple(steps)


def _cycles(world: World, load: JointLoad, chosen: tuple[str, ...]) -> Cycles:
    """Stress cycles of one rivet in one joint, Pa, about their own mean."""
    points = load.rest if "transient" in chosen else load.steady
    assert points is not None
    stress = world.given.stress_per_twist * points
    hits = world.printed.task.hits_per_rivet
    if "counting" not in chosen:
        peak = float(np.abs(stress).max())
        return Cycles(np.array([2.0 * peak]), np.zeros(1), np.array([float(hits)]))
    counted = rainflow(stress)
    return counted if "transient" in chosen else counted.repeated(hits)


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
