"""From a motion log to a life: which causes still act while the tool hits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from picchio.diagnosis.life import NO_SHAFT, has_strength, life_before_and_after
from picchio.diagnosis.motion.data.system import System
from picchio.diagnosis.motion.fit.state import State
from picchio.diagnosis.result import Diagnosis
from picchio.model.effects.effect import Effect
from picchio.model.motion import WINDUP
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.studies.tasks import Task

STANDS = "acts in the drive: motors assumed locked while the tool hits"
CARRIES = "carries part of the weight, which a blow meets as a mean load alone: state a balancer"
READS = "is in the readings, not in the robot"
NO_CAUSE = "no cause is claimed: the life is what picchio assess says of the nominal robot"
NO_TASK = "no task is known whose life could be told: give one with --task"
NONE_ACTS = "nothing that was found acts while the tool hits: the life is the nominal robot's"


@dataclass(frozen=True)
class BlowEffects:
    """The causes of a motion diagnosis, sorted by whether a blow meets them.

    Attributes:
        effects: those that change masses or what yields between link and motor.
        left: (effect, why) of the others.
    """

    effects: tuple[Effect, ...]
    left: tuple[tuple[Effect, str], ...]


@dataclass(frozen=True)
class MotionLife:
    """A task's life before and after.

    Attributes:
        life: as `picchio.diagnosis.life.life_before_and_after`; None where it can't be told.
        why: a sentence: why not, or what the life takes into account.
        blows: {"baseline": {...}, "extended": {...}} joint -> peak deflection, rad, by the same
            task; empty where there is none.
    """

    life: Mapping[str, Any] | None
    why: str
    blows: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


def effects_during_blows(diagnosis: Diagnosis) -> BlowEffects:
    """Which causes act on a robot whose motors stand still while its tool hits.

    Masses and what yields beyond the gear do. Friction, ripple and rotors are in the drive, and a
    motion does not tell on which side of the gear they rub: to leave them out is on the safe
    side, since friction damps. Which is which is seen from what an effect does to a motion.
    """
    if not diagnosis.causes:
        return BlowEffects((), ())
    system: System = diagnosis.details["systems"]["train"]
    state: State = diagnosis.details["extended"]
    kept, left = [], []
    for effect in state.effects:
        beyond, reads = _acts(system, effect)
        if beyond and type(effect).structure is not Effect.structure:
            kept.append(effect)
        else:
            left.append((effect, READS if reads else CARRIES if beyond else STANDS))
    return BlowEffects(tuple(kept), tuple(left))


def _acts(system: System, effect: Effect) -> tuple[bool, bool]:
    """Whether it changes what the gear transmits or how it yields; whether what is read."""
    beyond = reads = False
    for predictor in system.predictors:
        if not predictor.concerns(effect):
            continue
        nominal = predictor.nominal
        motion = replace(nominal, body=dict(nominal.body), added=[], gains={}, delays={})
        effect.motion(motion)
        beyond |= any(motion.body[joint] is not x for joint, x in nominal.body.items())
        beyond |= any(kind == WINDUP for kind, _, _ in motion.added)
        reads |= bool(motion.gains or motion.delays)
    return beyond, reads


def motion_life(robot: FlexibleRobot, task: Task | None, diagnosis: Diagnosis) -> MotionLife:
    """A task's life by the nominal robot and with what a motion log told.

    Args:
        robot: the nominal robot.
        task: its work.
        diagnosis: of its motion records.

    Raises:
        InputError: as `picchio.studies.assessment.run`.
    """
    if not diagnosis.causes:
        return MotionLife(None, NO_CAUSE)
    if task is None:
        return MotionLife(None, NO_TASK)
    if not robot.flexible_joints:
        return MotionLife(None, "no joint has a stiffness, so blows can't be followed: give one "
                          "with --flex")  # fmt: skip
    effects = effects_during_blows(diagnosis).effects
    found = life_before_and_after(robot, task, effects)
    blows = {
        side: {name: joint["peak_deflection"] for name, joint in found[side]["joints"].items()}
        for side in ("baseline", "extended")
    }
    if not has_strength(robot):
        return MotionLife(None, NO_SHAFT, blows)
    if not effects:
        return MotionLife(found, NONE_ACTS, blows)
    names = ", ".join(f"{e.name.replace('_', ' ')} of {e.target}" for e in effects)
    why = f"the life after takes {names} into account; what is in the drive or in the readings " \
        "does not act while the tool hits"  # fmt: skip
    return MotionLife(found, why, blows)
