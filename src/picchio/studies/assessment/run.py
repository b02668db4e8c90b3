"""The main job: how many rivets each joint survives on a task."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError, gathered, warn_user
from picchio.core.processes import one_thread
from picchio.core.provenance import provenance
from picchio.core.shown import seeing
from picchio.fatigue.counting.counter import Residue
from picchio.fatigue.mean_stress import Rule
from picchio.fatigue.miner import life, peak_damage
from picchio.fatigue.shaft_stress import check_shaft, shear_stress
from picchio.fatigue.sn.curve import MinerRule, SNCurve
from picchio.fatigue.sn.library import PAPER_SN_CURVE, load_sn_curve
from picchio.fatigue.standstill import false_brinelling, swings
from picchio.model.model import Model, ModelLike
from picchio.robot.annotations.tool_choice import tool_place
from picchio.robot.drives.reducer import Reducer
from picchio.robot.dynamics.pose import warn_beyond_limits
from picchio.robot.estimate.rigid import left_rigid
from picchio.robot.estimate.sidecar import refused_efforts
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.joint import Strength
from picchio.studies.assessment.backwards import allowable
from picchio.studies.assessment.checks import (
    assumptions_of,
    doubts_of,
    rate_sensitivity,
    steady_state_checks,
    warn_about_shafts,
    warn_about_yield,
)
from picchio.studies.assessment.inputs import inputs_of
from picchio.studies.assessment.result import Assessment, JointLife, OperationResult
from picchio.studies.default_task import LIFE, TaskLike, task_of
from picchio.studies.rivet.life_rules import LifeRule, PaperRule, RainflowRule, curves_of, peak
from picchio.studies.rivet.pose import Rivet, need_springs
from picchio.studies.tasks import Operation, Task
from picchio.studies.uncertainty.result import UncertainLife
from picchio.studies.uncertainty.run import uncertain_life

Method = Literal["rainflow", "paper"]
METHODS: tuple[Method, ...] = ("rainflow", "paper")
# Samples of the lives where the robot's own values have spreads: at most so many, and fewer of
# a task of many places, but never so few that the interval blurs.
_SAMPLES, _PLACES, _FEWEST = 2048, 8_192, 512
# Given for a joint as the largest value over all poses.
_LARGEST = (
    "peak_deflection", "peak_torque", "gravity_torque", "peak_shear_stress",
    "gravity_shear_stress", "peak_total_stress", "utilisation", "reducer_utilisation",
)  # fmt: skip


@one_thread()
def assess(
    robot: ModelLike,
    task: TaskLike = None,
    *,
    method: Method = "rainflow",
    sn_curve: str | SNCurve | None = None,
    residue: Residue = "half-cycles",
    mean_stress: Rule = "none",
    miner: MinerRule | None = None,
    paper_mean_stress: bool = False,
    gravity_stiffness: bool | None = None,
    gravity_balanced: bool | None = None,
    steady_check: bool = True,
    uncertainty: UncertainLife | bool = True,
    progress: Callable[[int, int], None] | None = None,
) -> Assessment:
    """Life of every joint of a robot on a riveting task (paper section 3.4, eqs. 18-22).

    Args:
        robot: as `load_robot` takes it, with stiffnesses, and shafts where stresses are wanted; or
            a model of it.
        task: operations and poses, or their file; the robot's example if not given, else
            `default_task`: rivets of 12 blows of 300 N, 4 ms wide, one every 40 ms.
        method: "rainflow" (each rivet from rest, ring-down included, cycles counted) or
            "paper" (steady state, peak stress, one cycle a hit).
        sn_curve: for all joints, instead of their own.
        residue: rainflow's rule for cycles that do not close.
        mean_stress: correction for gravity and feed force.
        miner: what cycles below the endurance limit do.
        paper_mean_stress: the paper's life at the mean of the poses' peak stresses (Table 2).
        gravity_stiffness: add dg/dq to the springs; as the model has it if not given.
        gravity_balanced: gravity leaves no torque in the joints; see `Model`; likewise.
        steady_check: also say what the steady state misjudges, and whether a resonance is near;
            False leaves NaN there and takes about half the time.
        uncertainty: where values of the robot have a spread, and the method is rainflow: the lives
            as distributions (True: with 2,048 samples at most, fewer for
            tasks of more than 4 places); False leaves them out, and every
            value counts as stated.
        progress: called with (poses done, poses in all).

    Returns:
        the assessment; with an estimated value, the medians stand as the rivets to failure.

    Raises:
        InputError: no flexible joint, an unknown method, a resonance without damping, a
            ring-down without end.
    """
    if method not in METHODS:
        raise InputError("unknown method", key="method", value=method, choices=METHODS)
    if paper_mean_stress and method != "paper":
        raise InputError("belongs to the method paper", key="paper_mean_stress", value=True)
    model = Model.of(robot, gravity_stiffness=gravity_stiffness, gravity_balanced=gravity_balanced)
    robot = model.robot
    need_springs(robot)
    task = task_of(robot, task)
    rule: LifeRule = PaperRule() if method == "paper" else RainflowRule(residue, mean_stress, miner)
    if sn_curve is None and method == "paper":
        sn_curve = PAPER_SN_CURVE
    place = tool_place(robot)
    with gathered() as said:
        if place.doubt:
            warn_user(place.doubt)
        curves = curves_of(robot, sn_curve, drives=method == "rainflow")
        warn_about_shafts(robot)
        for operation in task.operations:
            warn_beyond_limits(robot, operation.poses, f"operation {operation.name!r}")
        ratings = tuple(joint.ratings for joint in robot.flexible_joints)
    paper_curve = load_sn_curve(PAPER_SN_CURVE, quiet=True)
    job = _Job(model, rule, curves, ratings, paper_curve, steady_check)
    total = sum(len(operation.poses) for operation in task.operations)
    results, checks, torques = [], [], []
    done = 0
    for operation in task.operations:
        stacked: dict[str, FloatArray] = {}
        for k, pose in enumerate(operation.poses):
            for key, values in job.at_pose(operation, pose).items():
                if key not in stacked:
                    stacked[key] = np.empty((len(operation.poses), *values.shape), values.dtype)
                stacked[key][k] = values
            done += 1
            if progress is not None:
                progress(done, total)
        checks.append(stacked.pop("check"))
        torques.append(stacked.pop("reducer_torques").max(axis=0))
        results.append(
            OperationResult(
                name=operation.name,
                direction=operation.direction,
                excitation=operation.excitation.describe(),
                hits_per_rivet=operation.hits_per_rivet,
                rivets=operation.rivets,
                poses=operation.poses,
                **stacked,
            )
        )
    if paper_mean_stress:
        results = [_at_mean_stress(result, curves) for result in results]
    largest = np.max(torques, axis=0)
    joints = tuple(
        _joint_life(j, robot, task, results, curves[j], ratings[j], largest[j])
        for j in range(len(curves))
    )
    with gathered() as more:
        warn_about_yield(joints)
    steady = steady_state_checks(joints, task, results, checks)
    doubts = (*filter(None, [task.note]), *doubts_of(model, curves, steady, rule.needs))
    # At a frequency that is an estimate, the drawn cases tell what a resonance does.
    if steady_check and not any(joint.estimated for joint in robot.flexible_joints):
        rates = rate_sensitivity(model, task, joints, results, rule.needs)
        joints = tuple(replace(j, rate_sensitivity=rates[j.name][0]) for j in joints)
        doubts = (*doubts, *filter(None, (text for _, text in rates.values())))
    unsure = None
    # A force through every axis loads nothing, whatever the values are.
    parts = any(curves) or any(ratings)
    parts &= not any(curves) or any(joint.utilisation > 0.0 for joint in joints)
    reducers = tuple(joint.reducer for joint in robot.flexible_joints)
    if robot.spreads and rule.needs == "rest" and miner is None and parts:
        if uncertainty is True:
            unsure = uncertain_life(
                model, task, sn_curve=sn_curve, residue=residue, mean_stress=mean_stress,
                samples=max(_FEWEST, min(_SAMPLES, _PLACES // total)), totals=False,
            )  # fmt: skip
        elif uncertainty is not False:
            unsure = uncertainty
    if unsure is not None:
        guess = bool(unsure.estimated)
        joints = tuple(_with_spread(joint, unsure, guess) for joint in joints)
        doubts = (unsure.doubt(), *doubts)
    allowed = None
    if task.assumed and rule.needs == "rest" and miner is None and parts:
        allowed = allowable(
            model, task, LIFE, sn_curve=sn_curve, residue=residue, mean_stress=mean_stress,
            thorough=False,
        )  # fmt: skip
    limiting = _limiting(joints)
    lasts = limiting.life if limiting else math.inf
    if unsure is not None and unsure.estimated:
        lasts = unsure.robot.p50
    found = Assessment(
        robot=robot.name,
        method="paper, at the poses' mean stress" if paper_mean_stress else method,
        sn_curve=", ".join(dict.fromkeys(c.name for c in curves if c is not None)),
        assumptions=assumptions_of(rule, model, curves, reducers),
        joints=joints,
        operations=tuple(results),
        limiting_joint=limiting.name if limiting else None,
        rivets_to_failure=lasts,
        uncertainty=unsure,
        steady_state=steady,
        origins=robot.origins,
        task_note=task.note,
        provenance=provenance([*robot.files, *task.files]),
        inputs=inputs_of(
            model,
            task,
            curves,
            reducers,
            method=method,
            residue=residue,
            mean_stress=mean_stress,
            miner=miner,
            paper_mean_stress=paper_mean_stress,
        ),
        warnings=tuple(dict.fromkeys([*robot.warnings, *said, *more])),
        doubts=doubts,
        left_out=left_rigid(robot),
        refused=refused_efforts(robot),
        impossible=tuple(str(one) for one in robot.findings if one.severity == "impossible"),
        tool=place,
        allowable=allowed,
    )
    return seeing(found, robot=model, task=task)


@dataclass(frozen=True)
class _Job:
    """What every pose needs."""

    model: Model
    rule: LifeRule
    curves: tuple[SNCurve | None, ...]
    ratings: tuple[Reducer | Strength | None, ...]
    paper_curve: SNCurve
    both: bool

    def at_pose(self, operation: Operation, pose: FloatArray) -> dict[str, FloatArray]:
        """Every joint's numbers at one pose, each (n,)."""
        robot = self.model.robot
        rivet = Rivet(self.model, operation, pose)
        loads = rivet.loads(self.rule.needs, both=self.both)
        n = len(loads)
        columns = ("peak_deflection", "peak_shear_stress", "utilisation", "damage_per_rivet")
        others = ("gravity_shear_stress", "peak_total_stress", "reducer_utilisation",
                  "reducer_torque", "reducer_limit", "swing", "swing_cycles")  # fmt: skip
        out = {key: np.full(n, np.nan) for key in (*columns, *others)}
        out["steady_peak_deflection"] = np.array([peak(load.steady) for load in loads])
        out["rest_peak_deflection"] = np.array([peak(load.rest) for load in loads])
        out["check"], out["reducer_torques"] = np.full((2, n, 2), np.nan)
        governs = [""] * n
        own = out[f"{self.rule.needs}_peak_deflection"]
        out["peak_deflection"] = own.copy()
        out["peak_torque"] = rivet.stiffness * own
        out["gravity_torque"] = np.abs(rivet.gravity_torque)
        hits = operation.hits_per_rivet
        for j, (joint, load) in enumerate(zip(robot.flexible_joints, loads, strict=True)):
            if load.rest is not None:
                out["swing"][j], out["swing_cycles"][j] = swings(load.rest)
            ratings = self.ratings[j]
            if ratings is not None and load.rest is not None:
                torques = load.peak_torque_with_gravity, abs(load.stiffness * load.static)
                out["reducer_torques"][j] = torques
                limit = ratings.check_blows(*torques).governing
                governs[j], out["reducer_utilisation"][j] = limit.name, limit.share
                out["reducer_torque"][j], out["reducer_limit"][j] = limit.torque, limit.limit
            curve = self.curves[j]
            if curve is None:
                continue
            for key, value in zip(columns, self.rule(joint, load, hits, curve), strict=True):
                out[key][j] = value
            if joint.shaft is None:
                continue
            out["gravity_shear_stress"][j] = shear_stress(out["gravity_torque"][j], joint.shaft)
            if load.rest is not None:
                out["peak_total_stress"][j] = shear_stress(
                    load.peak_torque_with_gravity, joint.shaft
                )
            if load.steady is not None and load.rest is not None:
                # The paper's curve on both, so that only the steady state's share shows.
                out["check"][j] = (
                    PaperRule()(joint, load, hits, self.paper_curve).damage,
                    RainflowRule()(joint, load, hits, self.paper_curve).damage,
                )
        out["reducer_governed_by"] = np.array(governs, dtype=object)
        out["natural_frequencies"] = rivet.natural_frequencies
        out["tool_position"] = rivet.state.tool_position
        return out


def _at_mean_stress(result: OperationResult, curves: tuple[SNCurve | None, ...]) -> OperationResult:
    """The same operation with every pose at the mean of the poses' peak stresses."""
    changed = result.damage_per_rivet.copy()
    for j, curve in enumerate(curves):
        if curve is not None:
            mean = float(result.peak_shear_stress[:, j].mean())
            changed[:, j] = peak_damage(mean, result.hits_per_rivet, curve)
    return replace(result, damage_per_rivet=changed)


def _joint_life(
    j: int,
    robot: FlexibleRobot,
    task: Task,
    results: list[OperationResult],
    curve: SNCurve | None,
    ratings: Reducer | Strength | None,
    torques: FloatArray,
) -> JointLife:
    joint = robot.flexible_joints[j]
    strength = curve.static_strength if curve else math.nan
    # Each limit is for one of the two: their largest values give each limit's worst pose.
    check = brinelling = None
    warnings: tuple[str, ...] = ()
    if ratings is not None and np.isfinite(torques[0]):
        check = ratings.check_blows(*torques)
    if (reducer := joint.reducer) is not None and check is not None:
        cycles = [r.swing_cycles[:, j] * r.rivets for r in results]
        places = [r.poses[:, robot.flexible_index[j]] for r in results]
        swing = [r.swing[:, j] for r in results]
        brinelling = false_brinelling(
            reducer.output_bearing, *map(np.concatenate, (swing, cycles, places))
        )
        warnings = (*check.warnings, f"{reducer.name}: {brinelling.sentence}")
    # Miner over every pose and operation: eqs. 19-22 with a_i in the hits, b_i in the rivets.
    spent = {r.name: float(r.damage_per_rivet[:, j].sum() * r.rivets) for r in results}
    total = math.fsum(spent.values())
    per_rivet = total / task.rivets_per_pass
    ranked = [r.utilisation if curve is not None else r.peak_deflection for r in results]
    k = int(np.argmax([column[:, j].max() for column in ranked]))
    shares = {name: value / total for name, value in spent.items()} if total > 0.0 else {}
    largest: dict[str, Any] = {
        name: float(max(getattr(result, name)[:, j].max() for result in results))
        for name in _LARGEST
    }
    return JointLife(
        name=joint.name,
        kind=joint.kind,
        **largest,
        reducer=reducer.name if reducer is not None else "",
        estimated_drive=reducer is None and ratings is not None,
        worn="" if curve is None else "shaft" if curve.kind == "shear" else "drive",
        damage_per_rivet=per_rivet,
        rivets_to_failure=life(per_rivet) if curve is not None else math.nan,
        sn_curve=curve.name if curve is not None else "",
        worst_operation=results[k].name,
        worst_pose=int(ranked[k][:, j].argmax()),
        damage_share=shares,
        reducer_governed_by=check.governing.name if check is not None else "",
        reducer_limits=check.limits if check is not None else (),
        yield_utilisation=largest["peak_total_stress"] / strength,
        shaft_ratio=1.0 + check_shaft(joint.stiffness, joint.shaft) if joint.shaft else math.nan,
        reducer_warnings=warnings,
        false_brinelling=brinelling,
    )


def _with_spread(joint: JointLife, unsure: UncertainLife, guess: bool) -> JointLife:
    """The joint with its life as a distribution; of estimates the median is its life."""
    joint = replace(
        joint,
        intervals=unsure.intervals.get(joint.name, {}),
        ends_first=unsure.ends_first.get(joint.name, math.nan),
    )
    spread = unsure.joints.get(joint.name)
    if spread is None:
        return joint
    lasts = spread.p50 if guess else joint.rivets_to_failure
    return replace(joint, spread=spread, estimated=guess, rivets_to_failure=lasts)


def _limiting(joints: tuple[JointLife, ...]) -> JointLife | None:
    """The joint that ends the robot's life: the shortest, or else the most utilised part."""
    known = [joint for joint in joints if joint.sn_curve or joint.drive]
    if not known:
        return None
    return min(known, key=lambda j: (j.life, j.sure_life, -j.governing_utilisation))
