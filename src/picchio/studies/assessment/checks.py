"""What an assessment checks (shafts, reducers, yield, the steady state) and takes for granted."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from picchio.core import spoken
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError, warn_user
from picchio.fatigue.miner import life
from picchio.fatigue.shaft_stress import check_shaft
from picchio.fatigue.sn.curve import SNCurve
from picchio.model.model import Model
from picchio.robot.annotations.flexibility import ITS_REDUCER
from picchio.robot.drives.reducer import Reducer
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.joint import is_drive
from picchio.robot.spread import is_estimate
from picchio.studies.assessment.result import JointLife, OperationResult, SteadyStateCheck
from picchio.studies.assessment.verdict import MUCH_GROWTH, RATE_STEP, SHAFT_TOLERANCE, softer
from picchio.studies.rivet.life_rules import LifeRule, peak
from picchio.studies.rivet.pose import Rivet
from picchio.studies.tasks import Task

# Below this, in rad or m, a peak is rounding.
_ROUNDING = 1e-12


def warn_about_shafts(robot: FlexibleRobot) -> None:
    """Warn of joints without a shaft, and of shafts that do not fit their joint."""
    bare = [j.name for j in robot.flexible_joints if j.worn is None and is_drive(j.name)]
    if bare:
        warn_user(
            f"no shaft is given for {', '.join(bare)}: deflection and torque are given, stress "
            "and life are not"
        )
    for joint in robot.flexible_joints:
        if joint.shaft is None:
            continue
        ratio = 1.0 + check_shaft(joint.stiffness, joint.shaft)
        if ratio < 1.0 - SHAFT_TOLERANCE:
            problem = softer(ratio)
        elif ratio > 1.0 + SHAFT_TOLERANCE:
            problem = (
                f"is {ratio:.3g} times stiffer than the joint: something else yields as well, and "
                "the stress by the paper's formula (from the deflection) is too high by as much"
            )
        else:
            continue
        warn_user(f"{joint.name}: the shaft, by G Jp / l, {problem}")


def warn_about_yield(joints: tuple[JointLife, ...]) -> None:
    """Warn where gravity and blows together reach the static strength."""
    for joint in joints:
        if joint.yield_utilisation >= 1.0:
            stress = joint.peak_total_stress / 1e6
            strength = stress / joint.yield_utilisation
            warn_user(
                f"{joint.name}: gravity and blows together reach {stress:.4g} MPa in shear, and "
                f"{joint.sn_curve} yields at {strength:.4g} MPa: no fatigue life holds there"
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
    named = [r for r in dict.fromkeys(reducers) if r is not None]
    unchecked = [
        joint.name
        for joint, reducer in zip(model.robot.flexible_joints, reducers, strict=True)
        if reducer is None and joint.strength is None and is_drive(joint.name)
    ]
    lines = [
        f"gravity stiffness {'on' if model.gravity_stiffness else 'off'}",
        *(
            ("gravity is balanced: it leaves no torque in the joints",)
            if model.gravity_balanced
            else ()
        ),
        "motors assumed locked while the tool hits",
        *(f"the model has the effect {effect!r}" for effect in model.effects),
        *model.without_load(),
        *_estimates(model.robot),
        *rule.assumptions({curve.kind for curve in curves if curve}),
        *(f"{curve.title} {curve.describe()}" for curve in dict.fromkeys(c for c in curves if c)),
    ]
    if named:
        lines += [
            "reducers: the peak torque of gravity and blows against the catalogue's limits for "
            "repeated and momentary peaks, what is held against that for the average torque where "
            "the catalogue has one (the rated torque is for the rated life at the rated speed, no "
            "limit at standstill); a joint at rest under blows risks false brinelling, "
            "which no catalogue covers",
            "risk of false brinelling, a class and never a life: high where a joint stands in one "
            "place, low where it moves on by more than a contact's width after every pose (doi "
            "10.5194/wes-8-289-2023: wear in every steady oscillation, none with longer movements "
            "between); the contact's travel over its width (below 1 standstill marks, doi "
            "10.3390/lubricants11070311) is an estimate from the output bearing's ratings, at the "
            "moment that the catalogue allows",
            *(f"reducer {r.name}: {r.manufacturer}, {r.kind}; {r.source}" for r in named),
        ]
    if unchecked:
        lines.append(f"no reducer is checked in {', '.join(unchecked)}: none is named or known")
    return tuple(lines)


def rate_sensitivity(
    model: Model,
    task: Task,
    joints: tuple[JointLife, ...],
    results: list[OperationResult],
    needs: str,
) -> dict[str, tuple[float, str]]:
    """How the peaks answer to the rate of the blows, each joint at its worst rivet.

    Args:
        model: the robot and its effects.
        task: what it does.
        joints: as they fare.
        results: of the operations, in the task's order.
        needs: the response that is meant, "rest" or "steady".

    Returns:
        by joint the larger of the two peaks with the blows 5 % faster and slower over the peak as
        stated, and what to say of it, "" where that is not much.
    """
    solved: dict[tuple[str, int], tuple[Rivet, FloatArray, list[list[float]]]] = {}
    told = {}
    for k, joint in enumerate(joints):
        place = joint.worst_operation, joint.worst_pose
        if place not in solved:
            at = [op.name for op in task.operations].index(place[0])
            operation, as_stated = task.operations[at], results[at].peak_deflection[place[1]]
            stated = Rivet(model, operation, operation.poses[place[1]])
            periods = (1.0 + RATE_STEP, 1.0 - RATE_STEP)
            solved[place] = stated, as_stated, [_peaks(stated, f, needs) for f in periods]
        rivet, before, found = solved[place]
        peaks = [column[k] for column in found if column]
        moves = peaks and before[k] > _ROUNDING
        growth = max(peaks) / float(before[k]) if moves else math.nan
        text = ""
        if growth > MUCH_GROWTH:
            way = "slower" if found[0] and found[0][k] == max(peaks) else "faster"
            own = ", ".join(f"{f:.3g}" for f in rivet.natural_frequencies)
            text = (
                f"a resonance is near: blows {100 * RATE_STEP:g} % {way} raise the peak of "
                f"{joint.name} {growth:.3g} times ({place[0]}, pose {place[1] + 1}; "
                f"{1.0 / rivet.operation.excitation.period:.3g} Hz and its multiples, natural "
                f"frequencies {own} Hz)"
            )
        told[joint.name] = growth, text
    return told


def _peaks(stated: Rivet, factor: float, needs: str) -> list[float]:
    """Every joint's peak with the period times a factor, rad; none where the blows do not fit."""
    blows = stated.operation.excitation
    try:
        changed = replace(stated.operation, excitation=blows.with_period(factor * blows.period))
        loads = Rivet(stated.model, changed, stated.pose).loads(needs, both=False)
    except InputError:
        return []
    return [peak(getattr(load, needs)) for load in loads]


def doubts_of(
    model: Model,
    curves: tuple[SNCurve | None, ...],
    steady: tuple[SteadyStateCheck, ...],
    needs: str,
) -> tuple[str, ...]:
    """What lowers trust beside warnings: estimates, unverified curves, effects left out.

    Args:
        model: the robot and its effects.
        curves: of the joints.
        steady: what the steady state misjudges.
        needs: the response that the method takes, "rest" or "steady".
    """
    lines = [*_estimates(model.robot), *model.without_load()]
    for curve in dict.fromkeys(c for c in curves if c is not None):
        if curve.unverified:
            lines.append(f"{curve.title} {curve.name}: engineering assumption, no source, for "
                         f"{curve.unverified}")  # fmt: skip
    ratios = [(check.peak_ratio, check.joint) for check in steady if check.peak_ratio > 1.0]
    if needs == "steady" and ratios:
        ratio, name = max(ratios)
        lines.append(
            f"the method takes the steady state: from rest the peak of {name} is {ratio:.3g} times "
            "as high"
        )
    return tuple(lines)


_ESTIMATED_KEYS = {
    "stiffness": "stiffness",
    "damping_ratio": "damping",
    "strength": "what the drive bears",
}


def _estimates(robot: FlexibleRobot) -> list[str]:
    """What of the robot is an estimate or a default, one line a source."""
    said: dict[str, list[str]] = {}
    own: dict[tuple[str, ...], list[str]] = {}
    for joint in robot.flexible_joints:
        origin = {key: robot.origins.get(f"{joint.name}.{key}", "") for key in _ESTIMATED_KEYS}
        made = tuple(key for key, text in origin.items() if is_estimate(text))
        if made:
            own.setdefault(made, []).append(joint.name)
        if "stiffness" in made:
            continue
        known = {
            word: robot.spreads.get(f"{key}.{joint.name}")
            for word, key in (("stiffness", "stiffness"), ("damping", "damping_ratio"))
        }
        # A stiffness that was said to be an estimate is one whatever spread it was given.
        guesses = {
            word: math.exp(spread.size)
            for word, spread in known.items()
            if spread and (spread.estimated or (joint.estimated and word == "stiffness"))
        }
        if guesses:
            source = robot.origins.get(f"{joint.name}.stiffness", "marked as an estimate")
            what = "are estimates, not measurements" if guesses.keys() == known.keys() else (
                "is an estimate, not a measurement"
            )  # fmt: skip
            text = (
                f"{' and '.join(guesses)} {what}: taken to be within a factor of "
                f"{max(guesses.values()):.3g} (one standard deviation), and what follows is rough "
                f"({source})"
            )
            said.setdefault(text, []).append(joint.name)
        keys = (f"{joint.name}.stiffness", f"{joint.name}.stiffness_curve")
        if joint.reducer and any(robot.origins.get(k, "").startswith(ITS_REDUCER) for k in keys):
            text = (
                "stiffness is that of the reducer alone, from its catalogue; bearings, links and "
                "shafts in series make the joint softer and are not in it"
            )
            said.setdefault(text, []).append(joint.name)
        damping = robot.origins.get(f"{joint.name}.damping_ratio", "")
        if "default" in damping:
            text = f"damping ratio {joint.damping_ratio:g} is assumed ({damping})"
            said.setdefault(text, []).append(joint.name)
    every = [joint.name for joint in robot.flexible_joints]
    lines = [f"{spoken.those(names, every)}: {text}" for text, names in said.items()]
    for guessed, names in own.items():
        told = [f"{_ESTIMATED_KEYS[key]} within a factor of {_factors(robot, key, names)}"
                for key in guessed]  # fmt: skip
        lines.append(
            f"{spoken.those(names, every)}: estimated from the URDF: {', '.join(told)} (one "
            "standard deviation; picchio start writes the reasons)"
        )
    return lines


def _factors(robot: FlexibleRobot, key: str, names: list[str]) -> str:
    """By how much a value of some joints is uncertain, such as "1.8 to 2.4"."""
    path = f"{key}.repeated_peak_torque" if key == "strength" else key
    found = (robot.spreads.get(f"{path}.{name}") for name in names)
    told = [f"{math.exp(size):.2g}" for size in sorted(one.size for one in found if one)]
    return " to ".join(dict.fromkeys([told[0], told[-1]])) if told else "1"
