"""What an assessment checks (shafts, reducers, yield, the steady state) and takes for granted."""

from __future__ import annotations

import math

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import warn_user
from picchio.fatigue.miner import life
from picchio.fatigue.shaft_stress import check_shaft
from picchio.fatigue.sn.curve import SNCurve
from picchio.model.model import Model
from picchio.robot.annotations.flexibility import ITS_REDUCER
from picchio.robot.drives.reducer import Reducer
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.studies.assessment.result import JointLife, OperationResult, SteadyStateCheck
from picchio.studies.rivet.life_rules import LifeRule
from picchio.studies.tasks import Task

# A shaft that disagrees with its joint's stiffness by more than this is worth a warning.
_SHAFT_TOLERANCE = 0.05


def warn_about_shafts(robot: FlexibleRobot) -> None:
    """Warn of joints without a shaft, and of shafts that do not fit their joint."""
    bare = [joint.name for joint in robot.flexible_joints if joint.shaft is None]
    if bare:
        warn_user(
            f"no shaft is given for {', '.join(bare)}: deflection and torque are given, stress "
            "and life are not"
        )
    for joint in robot.flexible_joints:
        if joint.shaft is None:
            continue
        ratio = 1.0 + check_shaft(joint.stiffness, joint.shaft)
        if ratio < 1.0 - _SHAFT_TOLERANCE:
            problem = (
                f"is {1.0 / ratio:.3g} times softer than the joint it is a part of, which cannot "
                "be: radius, length or stiffness is wrong"
            )
        elif ratio > 1.0 + _SHAFT_TOLERANCE:
            problem = (
                f"is {ratio:.3g} times stiffer than the joint: something else yields as well, and "
                "the stress by the paper's formula (from the deflection) is too high by as much"
            )
        else:
            continue
        warn_user(f"{joint.name}: the shaft, by G Jp / l, {problem}")


def warn_about_yield(joints: tuple[JointLife, ...], curves: tuple[SNCurve | None, ...]) -> None:
    """Warn where gravity and blows together reach the static strength."""
    for joint, curve in zip(joints, curves, strict=True):
        if curve is None:
            continue
        strength = curve.yield_shear or curve.ultimate_shear
        if strength is not None and joint.peak_total_stress >= strength:
            warn_user(
                f"{joint.name}: gravity and blows together reach "
                f"{joint.peak_total_stress / 1e6:.4g} MPa in shear, and {curve.name} yields at "
                f"{strength / 1e6:.4g} MPa: no fatigue life holds there"
            )


def steady_state_checks(
    joints: tuple[JointLife, ...],
    task: Task,
    results: list[OperationResult],
    checks: list[FloatArray],
) -> tuple[SteadyStateCheck, ...]:
    """Peaks and lives over the whole task, whatever the method."""
    rivets = [operation.rivets for operation in task.operations]
    found = []
    for j, joint in enumerate(joints):
        spent = sum(c[:, j].sum(axis=0) * r for c, r in zip(checks, rivets, strict=True))
        paper, counted = np.asarray(spent) / task.rivets_per_pass
        found.append(
            SteadyStateCheck(
                joint.name,
                float(max(r.steady_peak_deflection[:, j].max() for r in results)),
                float(max(r.rest_peak_deflection[:, j].max() for r in results)),
                life(float(paper)) if np.isfinite(paper) else math.nan,
                life(float(counted)) if np.isfinite(counted) else math.nan,
            )
        )
    return tuple(found)


def assumptions_of(
    rule: LifeRule,
    model: Model,
    curves: tuple[SNCurve | None, ...],
    reducers: tuple[Reducer | None, ...],
) -> tuple[str, ...]:
    """Every assumption behind a result, estimates and defaults of the robot among them."""
    described = [curve.describe() for curve in dict.fromkeys(c for c in curves if c is not None)]
    named = [r for r in dict.fromkeys(reducers) if r is not None]
    unchecked = [
        joint.name
        for joint, reducer in zip(model.robot.flexible_joints, reducers, strict=True)
        if reducer is None
    ]
    lines = [
        f"gravity stiffness {'on' if model.gravity_stiffness else 'off'}",
        *(
            ("gravity is balanced: it leaves no torque in the joints",)
            if model.gravity_balanced
            else ()
        ),
        "the motor side of every joint stands still while the tool hits",
        *(f"the model has the effect {effect!r}" for effect in model.effects),
        *model.without_load(),
        *_estimates(model.robot),
        *(rule.assumptions() if described else ("each rivet starts from rest and rings down",)),
        *(f"S-N curve {text}" for text in described),
    ]
    if named:
        lines += [
            "reducers: the peak torque of gravity and blows against the catalogue's limits for "
            "repeated and momentary peaks, what is held against that for the average torque where "
            "the catalogue has one (the rated torque is for the rated life at the rated speed, no "
            "limit at standstill); a joint that stands still under blows risks false brinelling, "
            "which no catalogue covers",
            *(f"reducer {r.name}: {r.manufacturer}, {r.kind}; {r.source}" for r in named),
        ]
    if unchecked:
        lines.append(f"no reducer is checked in {', '.join(unchecked)}: none is named or known")
    return tuple(lines)


def _estimates(robot: FlexibleRobot) -> list[str]:
    """What of the robot is an estimate or a default, one line a source."""
    said: dict[str, list[str]] = {}
    for joint in robot.flexible_joints:
        if joint.estimated:
            source = robot.origins.get(f"{joint.name}.stiffness", "marked as an estimate")
            said.setdefault(f"stiffness is an estimate ({source})", []).append(joint.name)
        keys = (f"{joint.name}.stiffness", f"{joint.name}.stiffness_curve")
        if joint.reducer and any(robot.origins.get(k, "").startswith(ITS_REDUCER) for k in keys):
            text = (
                f"stiffness is that of the reducer {joint.reducer.name} alone, from its catalogue; "
                "bearings, links and shafts in series make the joint softer and are not in it"
            )
            said.setdefault(text, []).append(joint.name)
        damping = robot.origins.get(f"{joint.name}.damping_ratio", "")
        if "default" in damping:
            text = f"damping ratio {joint.damping_ratio:g} is assumed ({damping})"
            said.setdefault(text, []).append(joint.name)
    return [f"{', '.join(names)}: {text}" for text, names in said.items()]
