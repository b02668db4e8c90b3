"""What an assessment warns of: parts that cannot be, or that no life holds for."""

from __future__ import annotations

import warnings

from picchio.core.errors import InputError, PicchioWarning
from picchio.fatigue import SNCurve, check_shaft
from picchio.fatigue.reducer import Reducer
from picchio.fatigue.reducer_library import load_reducer
from picchio.robot import FlexibleRobot, Joint
from picchio.studies.assessment import JointLife

# A shaft that disagrees with its joint's stiffness by more than this is worth a warning.
_SHAFT_TOLERANCE = 0.05


def reducer_of(joint: Joint) -> Reducer | None:
    """The joint's reducer; one that no catalogue has is told and left unchecked."""
    if joint.reducer is None:
        return None
    try:
        return load_reducer(joint.reducer)
    except InputError as error:
        warnings.warn(f"{joint.name}: {error}; it is left unchecked", PicchioWarning, stacklevel=3)
        return None


def warn_about_shafts(robot: FlexibleRobot) -> None:
    """Warn of joints without a shaft, and of shafts that do not fit their joint."""
    bare = [joint.name for joint in robot.flexible_joints if joint.shaft is None]
    if bare:
        warnings.warn(
            f"no shaft is given for {', '.join(bare)}: deflection and torque can be told, stress "
            "and life can't",
            PicchioWarning,
            stacklevel=3,
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
        warnings.warn(
            f"{joint.name}: the shaft, by G Jp / l, {problem}", PicchioWarning, stacklevel=3
        )


def warn_about_yield(joints: tuple[JointLife, ...], curves: tuple[SNCurve | None, ...]) -> None:
    """Warn where gravity and blows together reach the static strength."""
    for joint, curve in zip(joints, curves, strict=True):
        if curve is None:
            continue
        strength = curve.yield_shear or curve.ultimate_shear
        if strength is not None and joint.peak_total_stress >= strength:
            warnings.warn(
                f"{joint.name}: gravity and blows together reach "
                f"{joint.peak_total_stress / 1e6:.4g} MPa in shear, and {curve.name} yields at "
                f"{strength / 1e6:.4g} MPa: no fatigue life holds there",
                PicchioWarning,
                stacklevel=3,
            )
