"""The life asked backwards: what force, how many hits, what shaft a wanted life allows."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from picchio.core.errors import InputError
from picchio.fatigue.allowable_load import largest_factor
from picchio.fatigue.counting.counter import Residue
from picchio.fatigue.counting.cycles import Cycles
from picchio.fatigue.mean_stress import Rule
from picchio.fatigue.miner import damage
from picchio.fatigue.sn.curve import SNCurve
from picchio.model.model import Model
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.joint import Joint
from picchio.studies.tasks import Task
from picchio.studies.uncertainty import LifeJob, Place, place_of

_MOST_HITS = 1 << 10


@dataclass(frozen=True)
class Allowable:
    """What a wanted life allows one joint; the other quantities stay as they are.

    Attributes:
        joint: its name.
        rivets: the wanted life, rivets of the task's mix.
        survival: the wanted probability that a specimen lives so long; None: the curve's own.
        force_factor: by which every blow's force may be multiplied; inf where the blows do not
            move the joint.
        radius: m, the smallest shaft radius, at the same joint stiffness.
        hits: blows a rivet may take; None where operations differ in it, or where more than 1024
            are allowed.
        life: rivets to failure as things are, at that survival.
    """

    joint: str
    rivets: float
    survival: float | None
    force_factor: float
    radius: float
    hits: int | None
    life: float

    def to_dict(self) -> dict[str, Any]:
        """For JSON; infinite numbers are None."""
        return {
            key: None if isinstance(value, float) and math.isinf(value) else value
            for key, value in dataclasses.asdict(self).items()
        }


def allowable(
    robot: FlexibleRobot,
    task: Task,
    curves: Mapping[str, SNCurve],
    rivets: float,
    *,
    survival: float | None = None,
    residue: Residue = "half-cycles",
    mean_stress: Rule = "none",
    gravity_balanced: bool = False,
) -> tuple[Allowable, ...]:
    """Allowable force, hits and shaft radius of every joint for a wanted life.

    Rivets start from rest and ring down, cycles are counted by rainflow. Gravity's stress does not
    grow with the force, but with a thinner shaft. Where the curve knows its yield strength in
    shear, the largest stress must stay below it, too.

    Args:
        robot: with shafts.
        task: what it does.
        curves: S-N curve of each joint that counts, by joint name.
        rivets: the wanted life, in rivets of the task's mix.
        survival: move each curve to this probability; None leaves it.
        residue: as in `assess`.
        mean_stress: as in `assess`.
        gravity_balanced: as in `assess`.

    Raises:
        InputError: no joint with shaft and curve, a life that is not positive, a curve without
            scatter where a survival is asked for, gravity alone too much.
    """
    if not (math.isfinite(rivets) and rivets > 0):
        raise InputError("must be positive", key="rivets", value=rivets)
    joints = [j for j in robot.flexible_joints if j.shaft is not None and j.name in curves]
    if not joints:
        raise InputError("no joint has a shaft and an S-N curve", key="curves")
    used = [curves[j.name] if survival is None else curves[j.name].at_survival(survival)
            for j in joints]  # fmt: skip
    columns = [robot.flexible_names.index(joint.name) for joint in joints]
    job = LifeJob(joints, columns, used, residue, mean_stress)
    model = Model(robot, gravity_balanced=gravity_balanced)
    places = [place_of(model, op, pose) for op in task.operations for pose in op.poses]
    loads = _loads(job, places)
    limit = task.rivets_per_pass / rivets
    after = _AfterHits(job, places)
    return tuple(
        _joint(job, k, after, loads[k], limit, task, rivets, survival) for k in range(len(joints))
    )


Load = list[tuple[Cycles, float, float]]
"""For each pose: the stress cycles of a rivet, the steady stress, the rivets set there."""


def _loads(job: LifeJob, places: Sequence[Place]) -> list[Load]:
    found = [job.cycles(place, 1.0, 1.0, 1.0) for place in places]
    return [
        [(*pose[k], place.rivets) for pose, place in zip(found, places, strict=True)]
        for k in range(len(job.joints))
    ]


class _AfterHits:
    """The loads after any number of blows, computed once for all joints."""

    def __init__(self, job: LifeJob, places: list[Place]) -> None:
        self._job, self._places = job, places
        self._known: dict[int, list[Load]] = {}

    def __call__(self, hits: int, joint: int) -> Load:
        if hits not in self._known:
            changed = [dataclasses.replace(place, hits=hits) for place in self._places]
            self._known[hits] = _loads(self._job, changed)
        return self._known[hits][joint]


def _joint(
    job: LifeJob,
    k: int,
    after: _AfterHits,
    load: Load,
    limit: float,
    task: Task,
    rivets: float,
    survival: float | None,
) -> Allowable:
    joint: Joint = job.joints[k]
    curve, rule = job.curves[k], job.mean_stress
    assert joint.shaft is not None
    strength = curve.yield_shear or curve.ultimate_shear or math.inf

    def spent(factor: float, steady_factor: float = 1.0, of: Load = load) -> float:
        if _largest(of, factor, steady_factor) >= strength:
            return math.inf
        return math.fsum(
            number * damage(cycles.scaled(factor).shifted(steady * steady_factor), curve, rule)
            for cycles, steady, number in of
        )

    # A stress below one pascal is rounding: the blows do not move this joint.
    moved = any(len(cycles) and cycles.range.max() > 1.0 for cycles, _, _ in load)
    force = largest_factor(spent, limit) if moved else math.inf
    slimmer = largest_factor(lambda f: spent(f, f), limit) if moved else math.inf
    now = spent(1.0)
    return Allowable(
        joint=joint.name,
        rivets=rivets,
        survival=survival,
        force_factor=force,
        radius=0.0 if math.isinf(slimmer) else joint.shaft.radius * slimmer ** (-1.0 / 3.0),
        hits=_hits(k, after, spent, limit, task) if moved else None,
        life=math.inf if now == 0.0 else task.rivets_per_pass / now,
    )


def _largest(load: Load, factor: float, steady_factor: float) -> float:
    """The largest stress of all, gravity and blows together, Pa."""
    largest = 0.0
    for cycles, steady, _ in load:
        held = steady * steady_factor
        largest = max(largest, abs(held))
        if len(cycles):
            swing = np.abs(held + factor * cycles.mean) + factor * cycles.amplitude
            largest = max(largest, float(swing.max()))
    return largest


def _hits(
    k: int, after: _AfterHits, spent: Callable[..., float], limit: float, task: Task
) -> int | None:
    """The most blows a rivet may take; the response to each number is computed anew."""
    if len({operation.hits_per_rivet for operation in task.operations}) != 1:
        return None

    def too_much(hits: int) -> bool:
        return spent(1.0, 1.0, after(hits, k)) > limit

    if not too_much(_MOST_HITS):
        return None
    low, high = 0, _MOST_HITS
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if too_much(middle) else (middle, high)
    return low
