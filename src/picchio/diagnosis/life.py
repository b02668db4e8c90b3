"""What a diagnosis does to the life: the same task by the nominal and the extended model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from picchio.model import Effect
from picchio.robot import FlexibleRobot
from picchio.studies import Task, assess


def life_before_and_after(
    robot: FlexibleRobot, task: Task, effects: Sequence[Effect], **options: Any
) -> dict[str, Any]:
    """The task's life by the robot's files, and with the effects that were found.

    Args:
        robot: as its files have it.
        task: its work.
        effects: of the extended model, fitted nuisances included.
        **options: of `picchio.studies.assess`.

    Returns:
        {"baseline": {...}, "extended": {...}}, each with rivets_to_failure (infinite where there
        is no end), utilisation (of the joint that has most), limiting_joint, and every joint's
        rivets_to_failure, utilisation and peak_deflection (rad).

    Raises:
        InputError: as `assess`.
    """
    return {
        "baseline": _life(robot, task, options),
        "extended": _life(with_effects(robot, effects), task, options),
    }


def with_effects(robot: FlexibleRobot, effects: Sequence[Effect]) -> FlexibleRobot:
    """The robot with effects that every study then takes into account, as a saved model's."""
    tables = tuple(effect.to_dict() for effect in effects)
    return replace(robot, effect_tables=(*robot.effect_tables, *tables))


def _life(robot: FlexibleRobot, task: Task, options: dict[str, Any]) -> dict[str, Any]:
    found = assess(robot, task, **options)
    return {
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
