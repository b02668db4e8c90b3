"""How sure a life is: stiffness, damping, blows, strength and the model itself as distributions."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from picchio.core.errors import InputError
from picchio.fatigue import SNCurve
from picchio.fatigue.mean_stress import Rule
from picchio.fatigue.rainflow import Residue
from picchio.fatigue.sampling import LifeSpread, Uncertain, design
from picchio.model import Model
from picchio.robot import FlexibleRobot
from picchio.studies.task import Task
from picchio.studies.uncertain_job import LifeJob, place_of

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
        from picchio.studies.verdict import format_count

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
