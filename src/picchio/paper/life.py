"""The life of the paper's task: its method, each correction of it, and what the inputs do to it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.fatigue.counting.counter import rainflow
from picchio.fatigue.counting.cycles import Cycles
from picchio.fatigue.mean_stress import Rule
from picchio.fatigue.miner import damage, life
from picchio.fatigue.sn.curve import SNCurve
from picchio.fatigue.sn.library import load_sn_curve
from picchio.paper.printed import Input, Printed, trials
from picchio.paper.world import Assumptions, World
from picchio.studies.rivet.pose import JointLoad, Rivet

STEEL = "42CrMo4-QT-shaft"
"""An ordinary shaft steel to compare the paper's curve with."""
CORRECTIONS = ("transient", "counting", "gravity", "curve")
_SEARCHED = 4000  # worlds: one in a hundred has the sequence


@dataclass(frozen=True)
class Step:
    """The life with some of the corrections.

    Attributes:
        name: in words.
        corrections: which.
        rivets: to failure; inf where nothing fails.
        joint: that fails first, from 1; 0 where none does.
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
            "limiting_joint": f"joint_{self.joint}" if self.joint else None,
            "without_endurance_limit": self.without_limit,
        }


def shaft_steel() -> SNCurve:
    """The curve of that steel."""
    return load_sn_curve(STEEL, quiet=True)


def waterfall(world: World) -> tuple[Step, ...]:
    """The life by the paper's method, by each correction alone, and by all together."""
    every = [(operation, pose) for operation in world.operations() for pose in operation.poses]
    rivets = [Rivet(world.model, operation, pose).loads() for operation, pose in every]
    gravity = np.tile(1e6 * world.gravity_stress, (3, 1))
    steel = shaft_steel()
    paper = world.printed.sn_curve.sn_curve(steel.tensile_strength)

    def lives(chosen: tuple[str, ...], curve: SNCurve) -> FloatArray:
        """(3,) rivets to failure: the rivets of the task in turn."""
        rule: Rule = "fkm" if "gravity" in chosen else "none"
        spent = [
            [
                damage(_cycles(world, load, chosen).shifted(mean), curve, rule)
                for load, mean in zip(loads, means, strict=True)
            ]
            for loads, means in zip(rivets, gravity.tolist(), strict=True)
        ]
        return np.array([life(float(d)) for d in np.mean(spent, axis=0)])

    steps = []
    for chosen in ((), *((name,) for name in CORRECTIONS), CORRECTIONS):
        curve = steel if "curve" in chosen else paper
        found = lives(chosen, curve)
        joint = int(np.argmin(found)) + 1 if np.isfinite(found).any() else 0
        endless = lives(chosen, curve.with_miner("elementary") if curve.knees else curve)
        name = trials().legends["+".join(chosen) or "none"]
        steps.append(Step(name, chosen, float(found.min()), joint, float(endless.min())))
    return tuple(steps)


def _cycles(world: World, load: JointLoad, chosen: tuple[str, ...]) -> Cycles:
    """Stress cycles of one rivet in one joint, Pa, about their own mean."""
    points = load.rest if "transient" in chosen else load.steady
    assert points is not None
    stress, hits = world.given.stress_per_twist * points, world.printed.task.hits_per_rivet
    if "counting" not in chosen:
        peak = float(np.abs(stress).max())
        return Cycles(np.array([2.0 * peak]), np.zeros(1), np.array([float(hits)]))
    return rainflow(stress).repeated(1 if "transient" in chosen else hits)


def paper_lives(world: World) -> FloatArray:
    """(3,) rivets to failure of each joint by the paper's own method, Miner over all rivets."""
    cycles = world.printed.sn_curve.cycles(world.rivet_stress)
    spent = (world.printed.task.hits_per_rivet / cycles).mean(axis=(0, 1))
    return np.array([life(float(d)) for d in spent])


def peak_over_amplitude(world: World) -> float:
    """Peak of the steady state over half its range, at the world's largest stress."""
    at, n, joint = world.at_worst
    value = at.response(world.blows, None).turning_points(n)[joint][1]
    return float(np.abs(value).max() / (0.5 * np.ptp(value)))


@dataclass(frozen=True)
class Influence:
    """One input over its range.

    Attributes:
        name: of the input.
        value: in the base world; tried: the values.
        lives: rivets to failure by the paper's method at the values that can be reached, the
            base world's first.
        dominant_joints: sequences of Fig. 9 that were seen, such as "2 3 3 1".
        why: what is known of it.
    """

    name: str
    value: Any
    tried: list[Any]
    lives: list[float]
    dominant_joints: list[str]
    why: str

    @property
    def factor(self) -> float:
        """Longest over shortest life."""
        return max(self.lives) / min(self.lives)

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {k: v for k, v in vars(self).items() if k != "name"} | {"factor": self.factor}


def influences(given: Assumptions, paper: Printed) -> tuple[Influence, ...]:
    """Every input, one at a time, the most influential first."""
    found = [_influence(given, paper, name, e) for name, e in trials().inputs.items()]
    return tuple(sorted(found, key=lambda i: -i.factor))


def _influence(given: Assumptions, paper: Printed, name: str, entry: Input) -> Influence:
    base = getattr(given, name)
    values = entry.choices or [entry.at(share) for share in np.linspace(0.0, 1.0, 7)]
    found = Influence(name, base, [], [], [], entry.why)
    for value in (base, *map(type(base), values)):
        world = World(given.but(**{name: value}), paper)
        try:
            found.lives.append(float(paper_lives(world).min()))
            found.tried.append(value)
            leads = " ".join(str(j + 1) for j in world.path_peaks.peak_deflection.argmax(axis=1))
        except InputError:
            continue  # a pattern or a path out of reach
        if leads not in found.dominant_joints:
            found.dominant_joints.append(leads)
    return found


@dataclass(frozen=True, eq=False)
class Sequences:
    """A search for worlds in which the joints dominate as Fig. 9 has it.

    Attributes:
        values: (tried, 4) of period, duty, damping ratio, x of the path.
        agree: (tried,) how many of the four heights agree.
        example: a world with the sequence, the one farthest from losing it; None if there is none.
        margin: by how much the example's dominant joints lead, at the closest height.
    """

    values: FloatArray
    agree: FloatArray
    example: World | None
    margin: float

    @property
    def counts(self) -> list[int]:
        """Worlds by how many of the four heights agree."""
        return [int((self.agree == k).sum()) for k in range(5)]

    @property
    def words(self) -> str:
        """The example."""
        if self.example is None:
            return ""
        given = {**vars(self.example.given), "margin": 100 * self.margin}
        return trials().legends["example"].format(ms=1e3 * given["period"], **given)


def find_sequences(given: Assumptions, seed: int, paper: Printed) -> Sequences:
    """Random worlds on the vertical path."""
    rng, frames = np.random.default_rng(seed), list(product(("cg", "joint"), ("down", "up")))
    names = ("period", "duty", "damping_ratio", "path_x")
    values, agree = np.empty((_SEARCHED, len(names))), np.empty(_SEARCHED)
    example, margin = None, -1.0
    for k in range(_SEARCHED):
        changes = {name: trials().inputs[name].at(rng.random()) for name in names}
        about, elbow = frames[rng.integers(len(frames))]
        world = World(given.but(inertia_about=about, elbow=elbow, **changes), paper)
        peaks = world.path_peaks.peak_deflection
        values[k] = list(changes.values())
        agree[k] = (peaks.argmax(axis=1) + 1 == paper.task.dominant_joints).sum()
        second, first = np.sort(peaks, axis=1)[:, -2:].T
        lead = float((first / second).min() - 1.0)
        if agree[k] == len(peaks) and lead > margin:
            margin, example = lead, world
    return Sequences(values, agree, example, margin)
