"""How sure a life is: stiffness, damping, blows, strength and the model itself as distributions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.core.html import sheet
from picchio.core.processes import one_thread
from picchio.core.results import TableResult
from picchio.fatigue.counting.counter import Residue
from picchio.fatigue.counting.cycles import Cycles
from picchio.fatigue.mean_stress import Rule
from picchio.fatigue.miner import damage, life, utilisation
from picchio.fatigue.sn.curve import SNCurve
from picchio.fatigue.uncertain_lives import LifeSpread, Uncertain, design
from picchio.model.model import Model
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.studies.assessment.result import format_count
from picchio.studies.rivet.variation import ShaftStress, VariedRivet, rivets_of
from picchio.studies.tasks import Task

# Relative, as the campaign's tolerances; the width and the model's error are judgements.
DEFAULT_INPUTS: dict[str, Uncertain] = {
    "stiffness": Uncertain(1.0, 0.05),
    "damping_ratio": Uncertain(1.0, 0.20),
    "force": Uncertain(1.0, 0.05),
    "width": Uncertain(1.0, 0.05),
    "model": Uncertain(1.0, 0.10),
}


@dataclass(frozen=True, repr=False)
class UncertainLife(TableResult):
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
        rows = [
            (name, *map(format_count, (s.p10, s.p50, s.p90)), 100 * s.endless)
            for name, s in {**self.joints, "robot": self.robot}.items()
        ]
        columns = ("rivets to failure", "P10", "P50", "P90", "without end [%]")
        return sheet("How sure the life is", {"varied": ", ".join(self.inputs)}, columns, rows)

    def _headline(self) -> str:
        lives = (format_count(x) for x in (self.robot.p10, self.robot.p50, self.robot.p90))
        return "rivets to failure P10 {}, P50 {}, P90 {}".format(*lives)

    def _rows(self) -> list[dict[str, Any]]:
        spreads = {**self.joints, "robot": self.robot}
        return [
            {"name": name, "p10": s.p10, "p50": s.p50, "p90": s.p90, "endless": s.endless}
            for name, s in spreads.items()
        ]

    def _content(self) -> dict[str, Any]:
        return vars(self)


@one_thread()
def uncertain_life(
    robot: FlexibleRobot | Model,
    task: Task,
    *,
    sn_curve: str | SNCurve | None = None,
    inputs: Mapping[str, Uncertain] | None = None,
    samples: int = 64,
    seed: int = 0,
    poses: int = 2,
    residue: Residue = "half-cycles",
    mean_stress: Rule = "none",
    gravity_stiffness: bool | None = None,
    gravity_balanced: bool | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> UncertainLife:
    """P10, P50 and P90 of every joint's life, and what makes them uncertain.

    Rivets start from rest and ring down, cycles are counted by rainflow (`assess`'s default). A
    factor on the stiffness is common to all joints. Specimens' strength scatters as each curve
    says, one rank for all joints; a curve without scatter counts as certain.

    Args:
        robot: with shafts; or a model of it.
        task: what it does.
        sn_curve: for all joints, instead of their own.
        inputs: factors on the nominal values, by name: "stiffness", "damping_ratio", "force",
            "width" (of the blows), "model" (error of the computed stress); if not given,
            `DEFAULT_INPUTS`, without the width where blows have none.
        samples: a power of two; the dynamics run about five times as often.
        seed: the same seed gives the same result.
        poses: how many poses of each operation and joint are sampled, the most strained ones; the
            rest keep their nominal share of the damage.
        residue: as in `assess`.
        mean_stress: as in `assess`.
        gravity_stiffness: as in `assess`.
        gravity_balanced: as in `assess`.
        progress: called with (runs done, runs in all).

    Returns:
        the lives as distributions.

    Raises:
        InputError: no joint with a shaft, an unknown input, a width where blows have none.
    """
    model = Model.of(robot, gravity_stiffness=gravity_stiffness, gravity_balanced=gravity_balanced)
    stress = ShaftStress.of(model.robot, sn_curve, None, residue, mean_stress)
    notes = []
    if inputs is None:
        inputs = dict(DEFAULT_INPUTS)
        if any(operation.excitation.width is None for operation in task.operations):
            del inputs["width"]
            notes.append("blows that state no width keep theirs")
    for name in inputs:
        if name not in DEFAULT_INPUTS:
            raise InputError("unknown input", key="inputs", value=name, choices=DEFAULT_INPUTS)
    places = rivets_of(model, task)
    sampler = _Sampler(stress, places, [len(op.poses) for op in task.operations], poses)
    varied = dict(inputs)
    if any(curve.scatter for curve in stress.curves):
        # A rank: ln of it is the specimen's standard normal score; each curve has its scatter.
        varied["strength"] = Uncertain(1.0, 1.0)
    plan = design(varied, samples=samples, seed=seed)
    lives, used = sampler.run(plan.values, progress)
    lives *= task.rivets_per_pass
    spreads = {
        joint.name: plan.summarise(lives[k], used[k])
        for k, joint in enumerate(stress.joints)
        if (used[k] > 0).all()
    }
    return UncertainLife(
        joints=spreads,
        robot=plan.summarise(lives.min(axis=0), used.max(axis=0)),
        inputs=varied,
        assumptions=(
            "inputs vary independently; a factor on the stiffness is common to all joints",
            f"{len(sampler.kept)} of {len(places)} poses sampled, the most strained; the rest keep "
            "their nominal share of the damage",
            "shares are of the variance of ln utilisation, which is finite where life is not",
            *notes,
            *model.without_load(),
        ),
        seed=seed,
    )


class _Sampler:
    """Lives of the sampled worlds.

    Args:
        stress: the joints that count.
        places: every rivet place, and the rivets of a pass set there.
        blocks: places of each operation.
        keep: how many of each operation and joint are sampled, the most strained ones.

    Attributes:
        kept: indices of the places that are sampled.
    """

    def __init__(
        self,
        stress: ShaftStress,
        places: list[tuple[VariedRivet, float]],
        blocks: list[int],
        keep: int,
    ) -> None:
        self._stress = stress
        found = [stress.cycles(place.varied()) for place, _ in places]
        spent = np.array([[self._spend(k, *p, 1.0) for k, p in enumerate(pose)] for pose in found])
        rivets = np.array([count for _, count in places])
        kept: set[int] = set()
        start = 0
        for block in blocks:
            order = np.argsort(-spent[start : start + block, :, 1], axis=0)
            kept |= {start + int(i) for i in order[:keep].ravel()}
            start += block
        self.kept = sorted(kept)
        self._places = [places[i] for i in self.kept]
        # Each joint's factor, 1 or more, on the damage of the places that are kept.
        whole, part = rivets @ spent[:, :, 0], rivets[self.kept] @ spent[self.kept, :, 0]
        self._left_out = np.where(part > 0, whole / np.where(part > 0, part, 1.0), 1.0)
        # Only of a linear model is the load proportional to the force.
        self._nonlinear = any(place.nonlinear for place, _ in self._places)

    def _spend(
        self, k: int, cycles: Cycles, steady: float | FloatArray, factor: float
    ) -> tuple[float, float]:
        """Damage and utilisation of joint k with its stress times `factor`."""
        load = Cycles.trusted(factor * cycles.range, factor * cycles.mean + steady, cycles.count)
        curve, rule = self._stress.curves[k], self._stress.mean_stress
        return damage(load, curve, rule), utilisation(load, curve, rule)

    def _per_pass(self, **factors: float) -> list[tuple[Cycles, FloatArray]]:
        """Each joint's cycles of all places, counted as often as rivets are set there.

        Beside them the steady stress under each cycle, Pa.
        """
        found = [
            self._stress.cycles(place.varied(**factors))  # type: ignore[arg-type]
            for place, _ in self._places
        ]
        joined = []
        for k in range(len(self._stress.joints)):
            parts = [pose[k] for pose in found]
            counts = [c.count * n for (c, _), (_, n) in zip(parts, self._places, strict=True)]
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

    def run(
        self, values: Mapping[str, FloatArray], progress: Callable[[int, int], None] | None
    ) -> tuple[FloatArray, FloatArray]:
        """Passes of the task to failure, and utilisation, each (n_joints, m)."""
        runs = len(next(iter(values.values())))
        one = np.ones(runs)
        dynamic = {
            "stiffness": values.get("stiffness", one),
            "damping": values.get("damping_ratio", one),
            "width": values.get("width", one),
        }
        force, load = values.get("force", one), values.get("model", one)
        if self._nonlinear:
            dynamic["force"] = force
        else:
            load = force * load
        score = np.log(values["strength"]) if "strength" in values else np.zeros(runs)
        lives = np.empty((len(self._stress.joints), runs))
        used = np.empty_like(lives)
        known: dict[tuple[float, ...], list[tuple[Cycles, FloatArray]]] = {}
        for m in range(runs):
            factors = {name: float(column[m]) for name, column in dynamic.items()}
            key = tuple(factors.values())
            if key not in known:
                known[key] = self._per_pass(**factors)
            for k, curve in enumerate(self._stress.curves):
                factor = float(load[m] / _strength(curve, score[m]))
                cycles, steady = known[key][k]
                spent, used[k, m] = self._spend(k, cycles, steady, factor)
                lives[k, m] = life(spent * self._left_out[k])
            if progress is not None:
                progress(m + 1, runs)
        return lives, used


def _strength(curve: SNCurve, score: float) -> float:
    """A specimen's strength over the curve's: 1 where the curve has no scatter."""
    if curve.survival is None or not curve.scatter:
        return 1.0
    return float(10.0 ** (curve.scatter * (score + NormalDist().inv_cdf(curve.survival))))
