"""What a diagnosis does to the life: the same task by the nominal and the extended model."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from statistics import NormalDist
from typing import Any

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.core.processes import one_thread
from picchio.core.recent import Recent
from picchio.core.workers import worker_pool
from picchio.diagnosis.attempt import trials
from picchio.model.effects.effect import Effect
from picchio.model.model import Model
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.studies.assessment.result import Assessment
from picchio.studies.assessment.run import assess
from picchio.studies.tasks import Task

LEVEL = 0.90
"""Of the two-sided intervals, as `picchio fit-sn` has them."""

NO_SHAFT = "no joint has a shaft or a reducer, so no life can be told: give them in the sidecar"
"""Why there is no life where there is none."""

# Poses of each operation and joint where design points are judged, the most strained ones: another
# one may be the worst there. Slopes are taken at each joint's worst alone.
_WORST = 2
# Poses whose geometry is kept while all values are looked at there.
_KEPT = 64
# Directions in which less is unknown than that do not move a life.
_KNOWN = 1e-7


@dataclass(frozen=True, eq=False)
class Uncertain:
    """Effects whose values are known up to a spread.

    Attributes:
        effects: coordinates (k,) -> the effects there.
        centre: (k,) where they most probably stand.
        covariance: (k, k) of the coordinates.
        lower, upper: (k,) bounds; beyond them the effects stay as they are there.
        told: (k,) where the model has them whose life is told, if not there.
    """

    effects: Callable[[FloatArray], Sequence[Effect]]
    centre: FloatArray
    covariance: FloatArray
    lower: FloatArray | float = -math.inf
    upper: FloatArray | float = math.inf
    told: FloatArray | None = None

    def room(self, step: FloatArray) -> float:
        """How many such steps there are to the nearest bound.

        Args:
            step: (parameters,) in the unit of each.
        """
        ends = np.where(step > 0.0, self.upper - self.centre, self.centre - self.lower)
        moved = np.abs(step) > 1e-12
        return float((ends[moved] / np.abs(step[moved])).min()) if moved.any() else math.inf


def has_strength(robot: FlexibleRobot) -> bool:
    """Whether any joint has a shaft or a reducer, which may fail.

    Args:
        robot: the robot.
    """
    return any(j.shaft is not None or j.reducer is not None for j in robot.flexible_joints)


def life_before_and_after(
    robot: FlexibleRobot,
    task: Task,
    effects: Sequence[Effect],
    *,
    before: Uncertain | None = None,
    after: Uncertain | None = None,
    others: Sequence[Sequence[Effect]] = (),
    causes: Sequence[tuple[str, str]] = (),
    workers: int | None = 1,
    **options: Any,
) -> dict[str, Any]:
    """The task's life by the robot's files, and with the effects that were found.

    Args:
        robot: as its files have it.
        task: its work.
        effects: of the extended model, fitted nuisances included.
        before: how well the nominal values are known, for an interval.
        after: the same of the extended model.
        others: effects of other models that the data cannot tell from this one.
        causes: (effect, target) of the effects that are causes; of several it is told what each
            does to the life.
        workers: processes, as `worker_pool` has them.
        **options: of `picchio.studies.assessment.run`.

    Returns:
        {"baseline": {...}, "extended": {...}}, each with rivets_to_failure (infinite where there
        is unlimited), utilisation (of the joint that has most), limiting_joint, and every joint's
        rivets_to_failure, utilisation and peak_deflection (rad). With a spread there are
        rivets_interval and utilisation_interval, too, of the robot and of every joint: two-sided,
        `LEVEL`, of what the model leaves open; how strong the material is, is not in them. With
        `others`, "alternatives" has a life like these, without intervals, for each; {"why": ...}
        where a model has none. Of several causes "causes" has rivets_to_failure and utilisation
        of the extended model with that one mended, the one that changes the life most first.

    Raises:
        InputError: as `assess`.
    """
    found: dict[str, Any] = {
        "baseline": _life(robot, task, options, before, robot, workers),
        "extended": _life(with_effects(robot, effects), task, options, after, robot, workers),
    }
    if any("rivets_interval" in found[side] for side in ("baseline", "extended")):
        found["interval_level"] = LEVEL
    for other in others:
        try:
            told = _life(with_effects(robot, other), task, options)
        except InputError as error:  # this set's model is none for this task
            told = {"why": str(error)}
        found.setdefault("alternatives", []).append(told)
    if len(causes) > 1:
        found["causes"] = _by_cause(robot, task, effects, causes, found["extended"], options)
    return found


def _by_cause(
    robot: FlexibleRobot,
    task: Task,
    effects: Sequence[Effect],
    causes: Sequence[tuple[str, str]],
    whole: Mapping[str, Any],
    options: dict[str, Any],
) -> list[dict[str, Any]]:
    """What each cause does to the life: how long it is once that one is mended."""
    rows = []
    for pair in causes:
        rest = [effect for effect in effects if (effect.name, effect.target) != pair]
        row: dict[str, Any] = {"effect": pair[0], "target": pair[1]}
        try:
            mended = _life(with_effects(robot, rest), task, options)
        except InputError as error:  # this cause alone makes the model one
            rows.append((0.0, 0.0, {**row, "why": str(error)}))
            continue
        lives = whole["rivets_to_failure"], mended["rivets_to_failure"]
        used = whole["utilisation"], mended["utilisation"]
        row |= {key: mended[key] for key in ("rivets_to_failure", "utilisation")}
        rows.append((_apart(*lives), _apart(*used), row))
    return [row for *_, row in sorted(rows, key=lambda each: each[:2], reverse=True)]


def matters(row: Mapping[str, Any], life: Mapping[str, Any]) -> bool:
    """Whether the life changes where a cause is mended.

    Args:
        row: one of the life's "causes".
        life: as `life_before_and_after` tells it.
    """
    keys = ("rivets_to_failure", "utilisation")
    return any(row.get(key) != life["extended"][key] for key in keys)


def _apart(one: float, other: float) -> float:
    """The distance of two numbers by their logarithms; none where both are without end."""
    if one == other:
        return 0.0
    if not (0.0 < one < math.inf and 0.0 < other < math.inf):
        return math.inf
    return abs(math.log(other / one))


def with_effects(robot: FlexibleRobot, effects: Sequence[Effect]) -> FlexibleRobot:
    """The robot with effects that every study then takes into account, as a saved model's."""
    tables = tuple(effect.to_dict() for effect in effects)
    return replace(robot, effect_tables=(*robot.effect_tables, *tables))


def _life(
    robot: FlexibleRobot,
    task: Task,
    options: dict[str, Any],
    unsure: Uncertain | None = None,
    bare: FlexibleRobot | None = None,
    workers: int | None = 1,
) -> dict[str, Any]:
    found = assess(robot, task, **{"uncertainty": False, **options})
    told: dict[str, Any] = {
        "rivets_to_failure": found.rivets_to_failure,
        "utilisation": max((joint.utilisation for joint in found.joints), default=0.0),
        "limiting_joint": found.limiting_joint,
        "joints": {
            joint.name: {
                "rivets_to_failure": joint.rivets_to_failure,
                "utilisation": joint.utilisation,
                "peak_deflection": joint.peak_deflection,
            }
            for joint in found.joints
        },
    }
    if unsure is None:
        return told
    intervals = life_intervals(bare or robot, task, found, unsure, options, workers)
    for name, each in intervals.items():
        told["joints"][name] |= each
    known = [joint for joint in found.joints if joint.name in intervals]
    if known:
        most = max(known, key=lambda joint: joint.utilisation)
        told["utilisation_interval"] = intervals[most.name]["utilisation_interval"]
        ends = [intervals[joint.name]["rivets_interval"] for joint in known]
        told["rivets_interval"] = (min(e[0] for e in ends), min(e[1] for e in ends))
    return told


def life_intervals(
    robot: FlexibleRobot,
    task: Task,
    found: Assessment,
    unsure: Uncertain,
    options: dict[str, Any],
    workers: int | None = 1,
) -> dict[str, dict[str, tuple[float, float]]]:
    """Intervals of every joint's life and utilisation, from how well a model's values are known.

    The most probable values at which the joint fares as badly (and as well) as the level asks
    for, by first-order reliability (Hasofer and Lind, J. Eng. Mech. Div. ASCE 100 (1974) 111):
    the slope of ln utilisation (and of ln damage), one standard deviation in every principal
    direction of the covariance, says where they lie; both are then computed there. What is told
    itself is within, too, where it is not that of the most probable values.

    Args:
        robot: without the effects.
        task: its work.
        found: the assessment at the centre.
        unsure: the effects and how well they are known.
        options: of `picchio.studies.assessment.run`.
        workers: processes, as `worker_pool` has them.

    Returns:
        joint -> {"rivets_interval": (low, high), "utilisation_interval": (low, high)}, of joints
        with an S-N curve; an unlimited life is infinite.

    Raises:
        InputError: as `assess`.
    """
    worst, single = _most_strained(task, found)
    z = NormalDist().inv_cdf(0.5 + 0.5 * LEVEL)
    settings = {**options, "steady_check": False, "uncertainty": False}
    bare = Model(robot, geometries=Recent(_KEPT))

    def at(vector: FloatArray, task: Task = worst) -> tuple[FloatArray, FloatArray] | None:
        """Utilisation and damage there; None where the model is none."""
        try:
            with warnings.catch_warnings():  # said once already, of the centre
                warnings.simplefilter("ignore")
                return _strain(assess(bare.with_effects(unsure.effects(vector)), task, **settings))
        except InputError:
            return None

    centre = at(unsure.centre, single)
    told_there = at(unsure.centre if unsure.told is None else unsure.told)
    if centre is None or told_there is None:
        return {}
    reference = told_there[0]
    sizes, directions = np.linalg.eigh(unsure.covariance)
    spread = directions * np.sqrt(np.maximum(sizes, 0.0))
    spread = spread[:, np.sqrt(np.maximum(sizes, 0.0)) > _KNOWN]

    def slope(step: FloatArray) -> FloatArray | None:
        return _slope(unsure, step, lambda vector: at(vector, single), *centre)

    def reached(asked: tuple[FloatArray, bool]) -> tuple[FloatArray, FloatArray] | None:
        """Share of the utilisation told, and damage, at a design point."""
        point, lives = asked
        there = at(point)
        # The most strained pose is the first to be damaged: no damage there, none at all.
        if lives and there is not None and there[1].any():
            whole = at(point, task)
            there = None if whole is None else (there[0], whole[1])
        return None if there is None else (there[0] / reference, there[1])

    functions: dict[str, Callable[[Any], Any]] = {"slope": slope, "reached": reached}
    told: dict[str, dict[str, tuple[float, float]]] = {}
    with one_thread(), worker_pool(workers, trials(functions)) as mapped:
        slopes = _of_both(mapped("slope", spread.T), len(found.joints))
        points = [
            [_design_points(unsure.centre, spread, own[:, j], z) for own in slopes]
            for j, joint in enumerate(found.joints)
            if joint.sn_curve
        ]
        # Where nothing is damaged both look at the same points.
        asked = {
            point.tobytes(): (point, lives)
            for lives in (False, True) for both in points for point in both[lives]
        }  # fmt: skip
        strains = dict(zip(asked, mapped("reached", list(asked.values())), strict=True))
    nothing = np.full((2, len(found.joints)), math.inf)  # where there is no model, nothing holds
    judged = ((k, joint) for k, joint in enumerate(found.joints) if joint.sn_curve)
    for (k, joint), both in zip(judged, points, strict=True):
        used, spent = (
            [float((strains[point.tobytes()] or nothing)[i][k]) for point in own]
            for i, own in enumerate(both)
        )
        lives = [task.rivets_per_pass / each if each > 0.0 else math.inf for each in spent]
        told[joint.name] = {
            "rivets_interval": _ends([*lives, joint.rivets_to_failure]),
            "utilisation_interval": _ends(
                [*(joint.utilisation * each for each in used), joint.utilisation]
            ),
        }
    return told


def _slope(
    unsure: Uncertain,
    step: FloatArray,
    at: Callable[[FloatArray], tuple[FloatArray, FloatArray] | None],
    reference: FloatArray,
    spent: FloatArray,
) -> FloatArray | None:
    """(2, joints): of ln utilisation and ln damage, over one step; None where no model is near."""
    # Away from a bound, and less far where the model is none or bounds are near.
    side = 1.0 if unsure.room(step) >= min(unsure.room(-step), 1.0) else -1.0
    for share in (side, -side, 0.25 * side, -0.25 * side):
        share *= min(unsure.room(np.sign(share) * step), 1.0)
        there = at(unsure.centre + share * step) if abs(share) > 1e-3 else None
        if there is not None:
            with np.errstate(divide="ignore", invalid="ignore"):
                return np.log([there[0] / reference, there[1] / spent]) / share
    return None


def _of_both(found: Sequence[FloatArray | None], joints: int) -> FloatArray:
    """(2, directions, joints): of ln utilisation and ln damage, a standard deviation each."""
    none = np.zeros((2, joints))
    slopes = np.array([none if each is None else each for each in found])
    slopes = slopes.reshape(-1, 2, joints).swapaxes(0, 1)
    # Where there is no damage its slope is none: utilisation's leads to where there may be some.
    slopes[1] = np.where(np.isfinite(slopes[1]).all(axis=0), slopes[1], slopes[0])
    slopes[~np.isfinite(slopes)] = 0.0
    return slopes


def _design_points(
    centre: FloatArray, spread: FloatArray, slope: FloatArray, z: float
) -> list[FloatArray]:
    """Where what has this slope (per column of the spread) is as large, as small, as z says."""
    size = float(np.linalg.norm(slope))
    if size == 0.0:
        return []
    return [centre + side * spread @ (slope / size) for side in (z, -z)]


def _strain(found: Assessment) -> tuple[FloatArray, FloatArray]:
    """Every joint's largest utilisation and its damage in a pass, (n,) each."""
    used = np.max([r.utilisation.max(axis=0) for r in found.operations], axis=0)
    spent = np.sum([r.damage_per_rivet.sum(axis=0) * r.rivets for r in found.operations], axis=0)
    return used, spent


def _ends(values: Sequence[float]) -> tuple[float, float]:
    return min(values), max(values)


def _most_strained(task: Task, found: Assessment) -> tuple[Task, Task]:
    """The task at every operation's and joint's most strained poses, and at every joint's alone."""
    used = [np.nan_to_num(result.utilisation) for result in found.operations]
    some = [np.unique(np.argsort(each, axis=0)[-_WORST:]) for each in used]
    first = np.cumsum([0, *map(len, used)])
    top = np.unique(np.argmax(np.concatenate(used), axis=0))
    one = [top[(top >= low) & (top < high)] - low for low, high in pairwise(first)]
    chosen = (
        tuple(
            replace(operation, poses=operation.poses[own])
            for operation, own in zip(task.operations, kept, strict=True)
            if own.size
        )
        for kept in (some, one)
    )
    worst, single = (replace(task, operations=operations) for operations in chosen)
    return worst, single
