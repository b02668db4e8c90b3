"""`picchio diagnose`: what the simulation gets wrong, why, the extended model, the gain."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from picchio.cli.options import FlexOption, JsonOption, RobotArgument, ToolOption
from picchio.core.errors import InputError

if TYPE_CHECKING:
    from picchio.campaign import Campaign
    from picchio.cli.diagnose_motion import MotionAnswer
    from picchio.diagnosis.percussion.diagnose import PercussionDiagnosis
    from picchio.model import Effect
    from picchio.robot import FlexibleRobot

EPILOG = "Example: picchio diagnose fanuc_like_3dof --data measurements/ --report why.html"


def register(app: typer.Typer) -> None:
    """Add the subcommand."""
    app.command(epilog=EPILOG)(diagnose)


def diagnose(
    robot: RobotArgument,
    data: Annotated[
        Path,
        typer.Option(
            "--data", metavar="CAMPAIGN", help="Folder with a campaign.toml.", show_default=False
        ),
    ],
    task: Annotated[
        Path | None,
        typer.Option("--task", metavar="FILE", help="For the life; the robot's own if not given."),
    ] = None,
    without: Annotated[
        list[str] | None,
        typer.Option("--without", metavar="EFFECT", help="Leave an effect out of consideration."),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option("--model", metavar="OUT.toml", help="The extended model, for any ROBOT."),
    ] = None,
    report: Annotated[
        Path | None, typer.Option("--report", metavar="OUT.html", help="One page to read.")
    ] = None,
    plan: Annotated[
        Path | None,
        typer.Option("--plan", metavar="OUT.toml", help="What to measure next, for `simulate`."),
    ] = None,
    flex: FlexOption = None,
    tool: ToolOption = None,
    gravity_stiffness: Annotated[
        bool,
        typer.Option(
            "--gravity-stiffness/--no-gravity-stiffness",
            help="Gravity's stiffness dg/dq beside the springs'.",
        ),
    ] = True,
    json: JsonOption = None,
) -> None:
    """What the simulation gets wrong about measured data, the cause, and what that does to life.

    The nominal model is fitted within the campaign's tolerance; what it cannot explain is held
    against every effect picchio knows; whole poses are held out to judge the gain. What cannot
    be known is said, and what to measure to know it.
    """
    from picchio.campaign import load_campaign
    from picchio.cli.diagnose_motion import diagnose_motion_records
    from picchio.cli.diagnose_tables import show_diagnosis
    from picchio.cli.output import check_target, console, said_warnings, write_json
    from picchio.core.files import atomic_write
    from picchio.core.provenance import provenance
    from picchio.model.effects import effect_class
    from picchio.robot import load_robot
    from picchio.studies import load_task

    for target in (json, report, model, plan):
        check_target(target, [robot, flex, task])
    for name in without or ():
        effect_class(name)
    campaign = load_campaign(data)
    kinds = {record.kind for record in campaign}
    # What a drive's torque tells needs no stiffness.
    loaded = load_robot(robot, flex=flex, tool=tool, allow_rigid=kinds == {"motion"})
    for target in (json, report, model, plan):
        check_target(target, [*loaded.files, *campaign.files])
    if task is not None:
        load_task(task, loaded)  # what is wrong with it is told now, not minutes later
    percussion: PercussionDiagnosis | None = None
    motion: MotionAnswer | None = None
    if kinds == {"motion"}:
        motion = diagnose_motion_records(loaded, campaign, without or (), task)
        found, effects, notes = motion.diagnosis, motion.carried.effects, motion.notes
        life = motion.life.life
    else:
        with _telling() as say:
            percussion = _percussion(loaded, campaign, without or (), gravity_stiffness, say)
        found, effects = percussion.diagnosis, percussion.extended.hypothesis.effects
        life, notes = _life(loaded, task, percussion), "found by picchio diagnose"
    text = _model_text(robot, flex, tool, effects, model, [*loaded.files, *campaign.files], notes)
    content = found.to_dict() | {"life": life} | (motion.extra() if motion is not None else {})
    content["scores"] = [dict(row) for row in found.scores]
    content["provenance"] = provenance([*loaded.files, *campaign.files])
    if model is not None:
        with atomic_write(model) as stream:
            stream.write(text)
    if report is not None:
        command = " ".join(["picchio", *map(shlex.quote, sys.argv[1:])])
        if motion is not None:
            page = motion.page(campaign, text, command, said_warnings())
        else:
            assert percussion is not None
            page = _page(percussion, text, command, life)
        with atomic_write(report) as stream:
            stream.write(page)
    asked = (found.next_measurement or {}).get("plan")
    if plan is not None and asked is not None:
        with atomic_write(plan) as stream:
            stream.write(asked)
    if json is not None:
        write_json(content, json)
    if json != "-":
        show_diagnosis(found, life)
        if motion is not None:
            console().print(f"Life: {motion.life.why}.")
        if plan is not None and asked is None:
            console().print(f"Nothing to measure next that a plan could say: {plan} not written.")


def _page(
    percussion: PercussionDiagnosis, text: str, command: str, life: Mapping[str, Any] | None
) -> str:
    from picchio.cli.output import said_warnings
    from picchio.view.report.diagnosis import diagnosis_report
    from picchio.view.scene import diagnosis_scene

    return diagnosis_report(
        percussion,
        model_toml=text,
        command=command,
        life=life,
        warnings=said_warnings(),
        scene=diagnosis_scene(percussion).html(),
    )


def _percussion(
    robot: FlexibleRobot,
    campaign: Campaign,
    without: list[str] | tuple[str, ...],
    gravity_stiffness: bool,
    say: Callable[[str], None],
) -> PercussionDiagnosis:
    from picchio.diagnosis.percussion.diagnose import diagnose_percussion

    return diagnose_percussion(
        robot, campaign, without=without, gravity_stiffness=gravity_stiffness, progress=say
    )


@contextmanager
def _telling() -> Iterator[Callable[[str], None]]:
    """What is being done, on stderr, where that is a terminal."""
    if not sys.stderr.isatty():
        yield lambda text: None
        return
    from rich.console import Console

    with Console(stderr=True).status("") as status:
        yield status.update


def _life(
    robot: FlexibleRobot, task: Path | None, percussion: PercussionDiagnosis
) -> dict[str, Any] | None:
    """Life before and after; None where there is no task or nothing was found."""
    from picchio.cli.output import say_warning
    from picchio.diagnosis.life import NO_SHAFT
    from picchio.studies import load_task

    path = task or robot.task_path
    if not any(j.shaft is not None or j.reducer is not None for j in robot.flexible_joints):
        if task is not None:
            say_warning(NO_SHAFT)
        return None
    if path is None or percussion.diagnosis.verdict in ("nothing-wrong", "unexplained"):
        return None
    try:
        return percussion.life(load_task(path, robot))
    except InputError as error:  # what took minutes to find is told all the same
        say_warning(f"the life could not be computed: {error}")
        return None


def _model_text(
    robot: str,
    flex: Path | None,
    tool: str | None,
    effects: tuple[Effect, ...],
    model: Path | None,
    files: list[Path],
    notes: str,
) -> str:
    from picchio.core.provenance import provenance
    from picchio.robot.saved_model import saved_model_text

    tables = [e.to_dict() for e in effects if e.values != type(e)(e.target).values or e.hidden]
    stamp = provenance(files)
    return saved_model_text(
        robot,
        tables,
        flex=flex,
        tool=tool,
        folder=model.parent if model is not None else None,
        notes=notes,
        provenance={"picchio": str(stamp.get("picchio", stamp.get("version", "")))},
    )
