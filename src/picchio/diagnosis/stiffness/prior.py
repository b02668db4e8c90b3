"""What is known of the springs before the tests."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from picchio.core.arrays import ComplexArray, FloatArray
from picchio.core.errors import InputError
from picchio.robot.flexible_robot import FlexibleRobot

FACTOR = 4.0
"""A stiffness of which nothing else is said lies within this factor of the stated one, at 90 %."""
UNKNOWN = math.log(FACTOR) / 1.645
"""Standard deviation of its logarithm."""
SIDEWAYS = 5.0
"""A bearing tilts as if it were so many times as stiff as its joint turns, in the median."""
REMAINDER = 0.01
"""What a model that is right may leave of functions and torques, as a share of them."""
OFFSET = 0.1
"""m, along each axis: how far from where it is told the force may act, if that is suspected."""
LOOSE = math.log(10.0) / 1.645
"""Standard deviation of the logarithm of any other stiffness: a factor of ten, at 90 %."""


@dataclass(frozen=True, eq=False)
class Prior:
    """The logarithms of the n joints' stiffness over the stated ones.

    Attributes:
        covariance: (n, n); the mean is zero: the stated values are the medians.
        stated: (n,) whether the robot's files state the spread.
    """

    covariance: FloatArray
    stated: tuple[bool, ...]

    @property
    def std(self) -> FloatArray:
        """(n,) of each."""
        return np.sqrt(np.diag(self.covariance))


def prior_of(robot: FlexibleRobot) -> Prior:
    """As the robot's files have it, and a factor of four where they state no spread.

    What a robot's drives are probably like is in its spreads, where `load_robot` estimated them
    (`picchio.robot.drives.priors`), and so is what earlier tests found.

    Every test for stiffness starts here, so a model with effects is refused here: what yields
    beside the joints is for the tests to tell.

    Args:
        robot: flexible.

    Returns:
        covariance of the logarithms of stiffness over the stated values.

    Raises:
        InputError: a saved model with effects.
    """
    if robot.effect_tables:
        labels = ", ".join(f"{table['effect']}:{table['target']}" for table in robot.effect_tables)
        raise InputError("tests for stiffness take the robot as its files have it, not a model "
                         "with effects", key="effect", value=labels,
                         hint=f"name the robot, {robot.name}")  # fmt: skip
    names = [f"stiffness.{joint.name}" for joint in robot.flexible_joints]
    size = np.full(len(names), UNKNOWN)
    stated = []
    for k, (name, joint) in enumerate(zip(names, robot.flexible_joints, strict=True)):
        spread = robot.spreads.get(name)
        stated.append(spread is not None and spread.size > 0.0)
        if spread is not None and spread.size > 0.0:
            size[k] = spread.size if spread.log else spread.size / joint.stiffness
    matrix = np.eye(len(names))
    known = robot.posterior.among(names) if robot.posterior is not None else None
    if known is not None:
        at = [names.index(name) for name in known.names]
        matrix[np.ix_(at, at)] = np.array(known.correlation)
    covariance = size[:, None] * matrix * size[None, :]
    # Rounded correlations may lie a hair beyond what can be.
    lift = max(0.0, 1e-9 * float(np.trace(covariance)) - float(np.linalg.eigvalsh(covariance)[0]))
    return Prior(covariance + lift * np.eye(len(names)), tuple(stated))


def damping_std(robot: FlexibleRobot) -> FloatArray:
    """(n,) of the logarithms of the joints' damping ratios, as the stiffness's.

    Args:
        robot: flexible.
    """
    spread = [robot.spreads.get(f"damping_ratio.{joint.name}") for joint in robot.flexible_joints]
    return np.array([one.size if one is not None and one.log and one.size > 0.0 else UNKNOWN
                     for one in spread])  # fmt: skip


@dataclass(frozen=True)
class Spring:
    """A compliance beside the joints'.

    Attributes:
        coordinates: that yield, all as stiff.
        stiffness: N m/rad or N/m, the median before the tests.
        std: of its logarithm.
        unit: of the stiffness.
    """

    coordinates: tuple[str, ...]
    stiffness: float
    std: float
    unit: str


@dataclass(frozen=True)
class Suspect:
    """What a robot or a test may have beside joint springs, of the catalogue of effects.

    Attributes:
        effect: its name there.
        target: likewise.
        words: what it is.
        spring: a compliance; None where it is none.
        loose: name of a number that is never exact -> its standard deviation, SI, if this is so.
        play: numbers of the joints with play.
    """

    effect: str
    target: str
    words: str
    spring: Spring | None = None
    loose: tuple[tuple[str, float], ...] = ()
    play: tuple[int, ...] = ()


def suspects(robot: FlexibleRobot, lever: float) -> list[Suspect]:
    """What is tried beside the joints' springs.

    The base in its six coordinates; the bearing of each joint and the link behind it, which bend
    across; another point where the force acts; play.

    Args:
        robot: flexible.
        lever: m, at which loads act on the base, about.
    """
    found = [
        Suspect("tool_offset", "tool", "the force acts elsewhere than told",
                loose=tuple((f"tool_point.{axis}", OFFSET) for axis in "xyz"))
    ]  # fmt: skip
    turning = [joint for joint in robot.flexible_joints if joint.kind == "revolute"]
    if not turning:
        return found
    stiffest = SIDEWAYS * max(joint.stiffness for joint in turning)
    for axis in ("rx", "ry", "rz", "x", "y", "z"):
        turns = axis.startswith("r")
        size, unit = (stiffest, "N*m/rad") if turns else (stiffest / lever**2, "N/m")
        words = f"the base {'turns about' if turns else 'moves along'} {axis[-1]}"
        spring = Spring((f"base.{axis}",), size, LOOSE, unit)
        found.append(Suspect("base_compliance", axis, words, spring))
    for joint in turning:
        for target, where, words in (
            (joint.name, "hinge", f"the bearing of {joint.name} tilts"),
            (robot.tree.joints[joint.name].child, "bend", f"the link behind {joint.name} bends"),
        ):
            names = (f"{where}.{joint.name}.1", f"{where}.{joint.name}.2")
            spring = Spring(names, SIDEWAYS * joint.stiffness, LOOSE, "N*m/rad")
            found.append(Suspect("transverse_compliance", target, words, spring))
        number = robot.flexible_names.index(joint.name)
        found.append(Suspect("backlash", joint.name, f"{joint.name} has play", play=(number,)))
    return found


def remainder_of(values: ComplexArray | FloatArray) -> float:
    """The variance that lets lines of a function, or rows of a torque, have a remainder.

    Thousands of them make a fit surer than its model is right. A remainder of a hundredth of the
    whole, as a diagnosis allows it, may look like any change of the numbers: its cosine with
    that is anything from -1 to 1. White noise of this size says as much.

    Args:
        values: (m,) the function or the torque, SI.

    Returns:
        of each row, or of the real and of the imaginary part of each line, SI squared.
    """
    return float(REMAINDER**2 * np.mean(np.abs(values) ** 2) * len(values) / 3.0)
