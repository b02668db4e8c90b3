"""What the nominal robot predicts of its motion, with what it leaves open."""

from __future__ import annotations

from lxml import etree

from picchio.diagnosis.motion.data.system import System
from picchio.diagnosis.motion.fit.state import State
from picchio.model.effects.effect import Effect
from picchio.model.effects.registry import catalogue
from picchio.model.motion import TORQUE
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.urdf.xml import parse_urdf, read_urdf_bytes


def baseline(system: System, tolerance: float) -> State:
    """The nominal model's state.

    The rigid bodies' torque of each joint may be off by the tolerance of forces: masses are
    rounded, currents calibrated. Friction that the URDF states is there, but friction is never
    known beforehand: it is fitted without prior.

    Args:
        system: the training equations.
        tolerance: relative standard deviation.
    """
    driven = [joint for kind, joint in system.groups if kind == TORQUE]
    return State(
        nuisances=stated_friction(system.robot, driven),
        scales=dict.fromkeys(driven, 1.0),
        tolerance=tolerance,
    )


def stated_friction(robot: FlexibleRobot, joints: list[str]) -> tuple[Effect, ...]:
    """The friction that the URDF states for these joints."""
    root = parse_urdf(read_urdf_bytes(robot.source), robot.source)
    found: list[Effect] = []
    for element in root.iter("joint"):
        name, dynamics = element.get("name"), element.find("dynamics")
        if name in joints and dynamics is not None:
            found += _stated(str(name), dynamics)
    return tuple(found)


def _stated(joint: str, dynamics: etree._Element) -> list[Effect]:
    found = []
    stated = [(*each, kind) for kind in catalogue().values() for each in kind.urdf.items()]
    for attribute, parameter, kind in sorted(stated, key=lambda each: each[:2]):
        try:
            value = float(dynamics.get(attribute) or 0.0)
        except ValueError:
            continue
        if value > 0.0:
            found.append(kind(joint, **{parameter: value}))
    return found
