"""What a click on a joint or a rivet tells: its numbers, what entered, and who says so."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from picchio.core import spoken
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.studies.assessment.result import Assessment, OperationResult
from picchio.studies.envelopes import DirectionEnvelope

Row = tuple[str, str, str]
"""Words, value with its unit, source ("" where it was computed)."""


def joint_card(
    robot: FlexibleRobot, k: int, envelope: DirectionEnvelope, assessment: Assessment | None
) -> dict[str, Any]:
    """One flexible joint's card.

    Args:
        robot: whose values entered, with their origins.
        k: its number among the flexible joints.
        envelope: at the scene's pose.
        assessment: of the task, where there is one.

    Returns:
        "rows" of `Row`, and "stress": Pa per rad (m), or None without a shaft.
    """
    joint, units = robot.flexible_joints[k], envelope.units[k]
    factor = float(envelope.stress_factor[k])
    rows: list[Row] = [
        ("worst peak here", f"{1e3 * envelope.peak_deflection[k]:.3g} {units.small}", ""),
        ("torque then", f"{envelope.peak('torque')[k]:.3g} {units.load}", ""),
    ]
    if not math.isnan(factor):
        rows.append(("stress then", f"{factor * envelope.peak_deflection[k] / 1e6:.3g} MPa", ""))
    if assessment is not None:
        life = assessment.joint(joint.name)
        rows.append(("utilisation on the task", f"{life.told_percent(life.governing_key)} %", ""))
        unit = "" if life.told_life in ("-", spoken.UNLIMITED) else " rivets"
        rows.append(("life on the task", f"{life.told_life}{unit}", ""))

    def source(*keys: str) -> str:
        told = (robot.origins.get(f"{joint.name}.{key}", "") for key in keys)
        return next(filter(None, told), "not said")

    per = "N m/rad" if units.load == "N m" else "N/m"
    rows.append(("stiffness", f"{envelope.torque_factor[k]:.4g} {per}",
                 source("stiffness", "stiffness_curve", "reducer")))  # fmt: skip
    rows.append(("damping ratio", f"{joint.damping_ratio:.3g}", source("damping_ratio")))
    if joint.shaft is not None:
        rows.append(("shaft", f"radius {1e3 * joint.shaft.radius:.4g} mm", source("shaft")))
    if joint.reducer is not None:
        rows.append(("reducer", joint.reducer.name, source("reducer")))
    if joint.strength is not None and joint.strength.repeated_peak_torque is not None:
        limit = f"{joint.strength.repeated_peak_torque:.4g} {units.load}, repeated"
        rows.append(("drive bears", limit, source("strength")))
    return {"rows": rows, "stress": None if math.isnan(factor) else factor}


def rivet_card(assessment: Assessment, operation: OperationResult, i: int) -> list[Row]:
    """One rivet's card.

    Args:
        assessment: of the task.
        operation: that sets it.
        i: which of its poses.

    Returns:
        its rows.
    """
    pose = ", ".join(f"{q:.4g}" for q in operation.poses[i])
    rows: list[Row] = [
        ("operation", f"{operation.name}, place {i + 1} of {len(operation.poses)}", ""),
        ("pose", f"({pose})", ""),
        ("blows", f"{operation.hits_per_rivet} of {operation.excitation}", ""),
    ]
    damage = operation.damage_per_rivet[i]
    names = [joint.name for joint in assessment.joints]
    if np.isfinite(damage).any() and np.nanmax(damage) > 0.0:
        j = int(np.nanargmax(damage))
        spent = sum(float(np.nansum(o.damage_per_rivet[:, j]) * o.rivets)
                    for o in assessment.operations)  # fmt: skip
        share = 100.0 * damage[j] * operation.rivets / spent
        rows.append(("damage", f"{damage[j]:.3g} a rivet, in {names[j]}", ""))
        rows.append(("alone it would last", f"{spoken.count(1.0 / damage[j])} rivets", ""))
        rows.append(("share", f"{share:.3g} % of the damage of {names[j]} on this task", ""))
    elif np.isfinite(damage).any():
        rows.append(("damage", "none: below the endurance limit", ""))
    use = np.fmax(operation.utilisation[i], operation.reducer_utilisation[i])
    if np.isfinite(use).any():
        j = int(np.nanargmax(use))
        rows.append(("utilisation", f"{spoken.per_cent(use[j])} %, in {names[j]}", ""))
    j = int(np.argmax(operation.peak_deflection[i]))
    unit = assessment.joints[j].units.small
    peak = f"{1e3 * operation.peak_deflection[i, j]:.3g} {unit}, in {names[j]}"
    rows.append(("peak deflection", peak, ""))
    return rows
