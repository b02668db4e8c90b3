"""The sidecar that stands in where a robot has none: its probable drives, each with its spread.

What is used in memory and what `picchio start` writes is this one record, its numbers rounded
here, so that both give the same life.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from picchio.core.errors import InputError
from picchio.robot.annotations.sidecar import JointEntry, Sidecar, spreads_of
from picchio.robot.drives.predictors import placeholders
from picchio.robot.drives.priors import DrivePriors, JointPrior, drive_priors
from picchio.robot.drives.strength import slide_strength
from picchio.robot.estimate.masses import SPREAD, estimated_masses, weighted
from picchio.robot.joint import Strength
from picchio.robot.link import LinkEntry
from picchio.robot.masses.check import WAYS_OUT, carrying, check_count
from picchio.robot.spread import ESTIMATE, Posterior, is_estimate
from picchio.robot.tool import Tool

if TYPE_CHECKING:
    from picchio.robot.drives.reducer import Reducer
    from picchio.robot.flexible_robot import FlexibleRobot

_TORQUES = ("repeated_peak_torque", "rated_torque", "momentary_peak_torque")
_DIGITS = 3
_POSSIBLE = (1e-2, 1e11)  # N m/rad, stiffnesses that a sidecar takes, and a little to spare
_NEARLY = 0.99  # off the diagonal, where rounding left a matrix that no variables can have


def estimated_sidecar(
    robot: FlexibleRobot,
    *,
    payload: float | None = None,
    reach: float | None = None,
    drive_class: str | None = None,
    reducers: Mapping[str, str | Reducer] | None = None,
) -> Sidecar:
    """A robot's probable drives, as a sidecar would have them.

    Args:
        robot: loaded; it may be rigid.
        payload: kg, see `picchio.robot.drives.priors.drive_priors`; likewise the rest.
        reach: m.
        drive_class: of the drives.
        reducers: by joint.

    Returns:
        every value with its spread, marked as an estimate; `source` says what it rests on.

    Raises:
        InputError: as `drive_priors`; the URDF's masses leave no joint any to move.
    """
    arm = robot.tree.chain(robot.tool_frame)
    check_count(robot, sum(joint.name in robot.joint_names for joint in arm))
    links = estimated_masses(robot)
    robot = weighted(robot, links)
    priors = drive_priors(
        robot, payload=payload, reach=reach, drive_class=drive_class, reducers=reducers
    )
    if links:
        why = f"the masses are estimates, to a factor of {SPREAD:g}"
        priors = priors.less_sure(SPREAD, why)
    kept = carrying(robot, [one.name for one in priors.joints])
    wrong = next((f"{one}" for one in robot.findings if one.severity == "impossible"), "")
    if not kept:
        raise InputError(wrong or "no joint that moves the tool moves a mass", key="link",
                         hint=WAYS_OUT)  # fmt: skip
    for one in priors.joints:
        if one.name in kept and not _POSSIBLE[0] < one.stiffness < _POSSIBLE[1]:
            told = f"they would take a drive of {one.stiffness:.1g} N m/rad"
            raise InputError(
                f"the masses beyond {one.name} cannot be: {wrong or told}",
                key="link", hint=WAYS_OUT,
            )  # fmt: skip
    return as_sidecar(robot, priors, reducers, links, kept)


def as_sidecar(
    robot: FlexibleRobot,
    priors: DrivePriors,
    reducers: Mapping[str, str | Reducer] | None = None,
    links: Mapping[str, LinkEntry] | None = None,
    kept: Collection[str] | None = None,
) -> Sidecar:
    """Drive priors as a sidecar.

    Args:
        robot: whose they are.
        priors: the drives.
        reducers: those given, by joint.
        links: estimated masses, by link.
        kept: joints that count; all of them if not given.

    Returns:
        the record, its numbers rounded.
    """
    named = {
        joint: one if isinstance(one, str) else one.name for joint, one in (reducers or {}).items()
    }
    joints = {
        one.name: _entry(one, named.get(one.name))
        for one in priors.joints
        if kept is None or one.name in kept
    }
    known = {spread.name for spread in spreads_of(Sidecar(joint=joints))}
    posterior = priors.posterior().among(known)
    return Sidecar(
        robot=robot.name,
        description=f"{robot.name}: drives estimated, none was measured",
        joint=joints,
        link=dict(links or {}),
        tool=Tool(frame=robot.tool_frame),
        posterior=None if posterior is None else _rounded(posterior),
    )


def slide_entries(robot: FlexibleRobot, names: Collection[str]) -> dict[str, JointEntry]:
    """What the drives of flexible slides bear, estimated from their effort limits.

    Args:
        robot: whose they are.
        names: joints of which it is not known.

    Returns:
        by joint, those that slide and have an effort limit.
    """
    found = {}
    refused = placeholders(robot)
    for joint in robot.flexible_joints:
        if joint.kind != "prismatic" or joint.name not in names or joint.name in refused:
            continue
        if not math.isfinite(joint.effort_limit):
            continue
        peak, spread = slide_strength(joint.effort_limit)
        bears = Strength(repeated_peak_torque=rounded(peak),
                         repeated_peak_torque_spread=rounded(spread), estimated=True)  # type: ignore[call-arg] # fmt: skip
        source = (
            f"from its effort limit, {joint.effort_limit:.3g} N, alone: no drive of a slide was "
            "measured, so the range is a judgement"
        )
        found[joint.name] = JointEntry(strength=bears, source=source)
    return found


def refused_efforts(robot: FlexibleRobot) -> dict[str, str]:
    """Why the URDF's effort limit counts as unknown, where what a drive bears would rest on it.

    Args:
        robot: as loaded.

    Returns:
        by joint, those whose strength is picchio's own estimate, or not known.
    """
    asked = [
        joint.name
        for joint in robot.flexible_joints
        if joint.shaft is None
        and joint.reducer is None
        and is_estimate(robot.origins.get(f"{joint.name}.strength", ESTIMATE))
    ]
    refused = placeholders(robot) if asked else {}
    return {name: refused[name] for name in asked if name in refused}


def rounded(value: float) -> float:
    """To three significant digits: an estimate has no more.

    Args:
        value: any.

    Returns:
        the rounded value.
    """
    return float(f"{value:.{_DIGITS}g}")


def _entry(prior: JointPrior, reducer: str | None) -> JointEntry:
    bears = {key: rounded(getattr(prior, key)) for key in _TORQUES}
    for key in _TORQUES[:2]:
        spread = rounded(getattr(prior, f"{key}_spread"))
        if spread > 1.0:  # a named reducer's is known
            bears[f"{key}_spread"] = spread
    values: dict[str, Any] = {
        "stiffness": rounded(prior.stiffness),
        "stiffness_spread": rounded(prior.stiffness_spread),
        "damping_ratio": rounded(prior.damping_ratio),
        "damping_ratio_spread": rounded(prior.damping_ratio_spread),
        "strength": Strength(**bears, estimated="repeated_peak_torque_spread" in bears),
        "source": f"Stiffness: {'; '.join(prior.reasons)}. "
        f"Torques: {'; '.join(prior.strength_reasons)}.",
        "estimated": True,
    }
    if reducer is not None:
        values["reducer"] = reducer
    return JointEntry(**values)


def _rounded(posterior: Posterior) -> Posterior:
    """Correlations to three decimals, such as variables can have."""
    exact = np.array(posterior.correlation)
    matrix = exact.round(_DIGITS)
    while np.linalg.eigvalsh(matrix)[0] < 0.0:
        exact = _NEARLY * exact + (1.0 - _NEARLY) * np.eye(len(exact))
        matrix = exact.round(_DIGITS)
    rows = tuple(tuple(row) for row in (matrix + 0.0).tolist())
    return Posterior(names=posterior.names, correlation=rows)
