"""What a simulation gets wrong about measured records, why, and what that does to the life."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from picchio.campaign.campaign import Campaign, load_campaign
from picchio.core.errors import InputError, warn_user
from picchio.core.processes import one_thread
from picchio.core.provenance import provenance
from picchio.diagnosis.life import NO_SHAFT, has_strength
from picchio.diagnosis.mixed import diagnose_mixed
from picchio.diagnosis.motion.conclude.during_blows import (
    BlowEffects,
    MotionLife,
    effects_during_blows,
    motion_life,
)
from picchio.diagnosis.motion.diagnosis import diagnose_motion
from picchio.diagnosis.percussion.conclude.causes import fitted_correlation
from picchio.diagnosis.percussion.diagnosis import PercussionDiagnosis, diagnose_percussion
from picchio.diagnosis.percussion.search.candidates import not_looked_for
from picchio.diagnosis.result import Cause, Diagnosis
from picchio.model.effects.effect import Effect
from picchio.model.effects.registry import effect_class
from picchio.model.model import Model
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.loading.find import shipped_robot
from picchio.robot.loading.load import load_robot
from picchio.robot.loading.objects import RobotLike, named
from picchio.robot.loading.saved_model import is_saved_model
from picchio.studies.tasks import Task, load_task

_FOUND = "found by picchio diagnose"
_MAKES_UP = (
    "; masses and what else is never exact stand as stated here, so values differ a little from "
    "those told: together they do as the records say"
)


@one_thread()
def diagnose(
    robot: RobotLike,
    campaign: str | Path | Campaign,
    *,
    task: str | Path | Task | None = None,
    without: Collection[str] = (),
    flex: str | Path | None = None,
    tool: str | None = None,
    gravity_stiffness: bool | None = None,
    workers: int | None = None,
    train: Collection[str] = (),
    held_out: Collection[str] = (),
    progress: Callable[[str], None] | None = None,
) -> Diagnosis:
    """What the simulation of a robot gets wrong about measured records, and why.

    Percussion records, motion records, or both: of a campaign with both kinds each has its own
    search, and the causes that both can show have one value (see `picchio.diagnosis.mixed`).

    Args:
        robot: the nominal robot, its name or its file.
        campaign: the records, or the folder with their campaign.toml.
        task: whose life is told before and after; the robot's own example task if None.
        without: names of effects that must not be considered.
        flex: sidecar of the robot.
        tool: the frame that carries the tool.
        gravity_stiffness: whether gravity's stiffness dg/dq counts beside the springs'; on if not
            given, unless a saved model says otherwise.
        workers: processes for percussion records (Linux only); as many as cores if None. The
            result is the same.
        train: names of motion records to fit to; chosen by how the joints move if not given.
        held_out: names of motion records to judge by; all others that are not in `train`.
        progress: told what is being done.

    Returns:
        verdict, causes, gain, life, the extended model and what to measure next.

    Raises:
        InputError: records that can't be predicted for this robot, an unknown effect, a task that
            was asked for and can't be used.
    """
    for name in without:
        effect_class(name)
    records = load_campaign(campaign).of_work("a diagnosis")
    kinds = {record.kind for record in records}
    if (train or held_out) and "motion" not in kinds:
        raise InputError("names motion records, and there is none: of blows, whole poses are held "
                         "out", key="train" if train else "held_out")  # fmt: skip
    # What a drive's torque tells needs no stiffness.
    loaded = load_robot(robot, flex=flex, tool=tool, allow_rigid=kinds == {"motion"})
    gravity_stiffness = loaded.adds_gravity(gravity_stiffness, usual=True)
    work: Task | None = None
    if task is not None:  # what is wrong with it is told now, not minutes later
        work = task if isinstance(task, Task) else load_task(task, loaded)
    say = progress or (lambda text: None)
    answer: Diagnosis
    effects: Sequence[Effect]
    notes = _FOUND
    if kinds == {"motion"}:
        found = diagnose_motion(
            loaded, records, without=without, train=train, held_out=held_out,
            progress=lambda done, total: say(f"motion records: {done} of {total}"),
        )  # fmt: skip
        acting, told = effects_during_blows(found), _motion_life(loaded, found, work)
        effects, notes = acting.effects, f"{_FOUND} in motion records{_left_out(acting)}"
        blows = {side: dict(joints) for side, joints in told.blows.items()}
        answer = replace(
            found, life=told.life, life_note=told.why,
            extra={**found.extra, "blows": blows or None},
            details={"motion": found, "during_blows": acting, "motion_life": told},
        )  # fmt: skip
    else:
        options: dict[str, Any] = {
            "without": without, "gravity_stiffness": gravity_stiffness, "workers": workers,
            "progress": progress,
        }  # fmt: skip
        hit: PercussionDiagnosis
        if "motion" in kinds:
            answer = diagnose_mixed(loaded, records, train=train, held_out=held_out, **options)
            hit = answer.details["percussion"]
            notes += _left_out(answer.details["during_blows"])
        else:
            hit = diagnose_percussion(loaded, records, **options)
            answer = replace(hit.diagnosis, details={"percussion": hit})
        effects = hit.effects
        if effects != hit.extended.hypothesis.effects:
            notes += _MAKES_UP
        known = fitted_correlation(hit.extended) if answer.verdict != "unexplained" else None
        moves = answer.details.get("motion")
        if known is not None and moves is not None:
            known = known.beside(moves.correlation)
        life = _percussion_life(hit, answer, work)
        answer = replace(
            answer, correlation=known, not_looked_for=not_looked_for(hit.problem),
            causes=_worst_first(answer.causes, life), life=life,
        )  # fmt: skip
    files = [*loaded.files, *records.files]
    folder = None if records.folder is None else records.folder.name
    stamp = provenance(files)
    tables = [e.to_dict() for e in effects if e.values != type(e)(e.target).values or e.hidden]
    saved = {
        **_named(robot, loaded, flex, tool), "effects": tables, "notes": notes,
        "gravity_stiffness": None if kinds == {"motion"} else gravity_stiffness,
        "provenance": {"picchio": str(stamp["picchio"])},
    }  # fmt: skip
    return replace(
        answer,
        model=Model(loaded, gravity_stiffness).with_effects(effects),
        extra={**answer.extra, "provenance": stamp},
        details={**answer.details, "saved": saved, "folder": folder},
    )


def _left_out(acting: BlowEffects) -> str:
    """What a model's file says of causes that it does not hold."""
    why: dict[str, list[str]] = {}
    for effect, reason in acting.left:
        names = why.setdefault(reason, [])
        name = f"{effect.name} of {effect.target}"
        if name not in names:
            names.append(name)
    said = [f"{', '.join(names)}: {reason}" for reason, names in why.items()]
    return f"; found as well, and not in this model: {'; '.join(said)}" if said else ""


def _task_of(robot: FlexibleRobot, task: Task | None) -> Task | None:
    """The task that was asked for, else the robot's own."""
    if task is not None or robot.task_path is None:
        return task
    return load_task(robot.task_path, robot)


def _motion_life(robot: FlexibleRobot, found: Diagnosis, task: Task | None) -> MotionLife:
    try:
        return motion_life(robot, _task_of(robot, task), found)
    except InputError as error:
        if task is not None:
            raise
        return MotionLife(None, f"the life could not be computed: {error}")


def _percussion_life(
    hit: PercussionDiagnosis, answer: Diagnosis, task: Task | None
) -> dict[str, Any] | None:
    """Life before and after; None where there is no task or nothing was found."""
    robot = hit.problem.robot
    if not has_strength(robot):
        if task is not None:
            warn_user(NO_SHAFT)
        return None
    if answer.verdict in ("nothing-wrong", "unexplained"):
        return None
    try:
        work = _task_of(robot, task)
        return None if work is None else hit.life(work)
    except InputError as error:  # what took minutes to find is told all the same
        warn_user(f"the life could not be computed: {error}")
        return None


def _worst_first(causes: Sequence[Cause], life: Mapping[str, Any] | None) -> tuple[Cause, ...]:
    """Causes in the order of what they do to the life, where that is known."""
    order = [(row["effect"], row["target"]) for row in (life or {}).get("causes", ())]
    known = {pair: place for place, pair in enumerate(order)}
    return tuple(sorted(causes, key=lambda c: known.get((c.effect, c.target), len(known))))


def _named(
    robot: RobotLike,
    loaded: FlexibleRobot,
    flex: str | Path | None,
    tool: str | None,
) -> dict[str, Any]:
    """How a model's file names the robot, its sidecar, its tool, and values given in Python."""
    if not isinstance(robot, FlexibleRobot):
        return {"robot": str(named(robot)), "flex": flex, "tool": tool}
    changed = getattr(loaded.again, "keywords", {})
    saved = [file for file in loaded.files if is_saved_model(file)]
    shipped = shipped_robot(loaded.name)
    if saved:
        return {"robot": str(saved[-1]), **changed}
    if shipped is not None and shipped.urdf == loaded.source:
        return {"robot": loaded.name, **changed}
    sidecars = [file for file in loaded.files if file.suffix == ".toml"]
    return {"robot": str(loaded.source), "flex": sidecars[0] if sidecars else None,
            "tool": loaded.tool_frame, **changed}  # fmt: skip
