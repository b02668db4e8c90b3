"""`picchio diagnose`: what the simulation gets wrong, why, the extended model, the gain."""

from __future__ import annotations

import math
import shlex
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from picchio.cli.options import FlexOption, JsonOption, RobotArgument, ToolOption
from picchio.core.errors import InputError

if TYPE_CHECKING:
    from picchio.campaign.campaign import Campaign
    from picchio.diagnosis.motion.conclude.during_blows import BlowEffects, MotionLife
    from picchio.diagnosis.percussion.diagnosis import PercussionDiagnosis
    from picchio.diagnosis.result import Diagnosis
    from picchio.model.effects.effect import Effect
    from picchio.robot.flexible_robot import FlexibleRobot


# What `picchio diagnose` prints.


def show_diagnosis(found: Diagnosis, life: Mapping[str, Any] | None) -> None:
    """Print verdict, causes, gain, life and what to measure next."""
    from rich.table import Table

    from picchio.cli.output import console
    from picchio.diagnosis.result import VERDICTS, differences, in_words
    from picchio.model.effects.registry import effect_class
    from picchio.studies.assessment.result import format_count

    out = console()
    out.print(f"[bold]{found.verdict}[/bold]: {found.note or VERDICTS[found.verdict]}.")
    if found.causes:
        table = Table(box=None, pad_edge=False, header_style="dim")
        for name in ("cause", "where", "confidence", "value", "std", "unit"):
            table.add_column(name, justify="right" if name in ("value", "std") else "left")
        for cause in found.causes:
            if not cause.parameters:
                table.add_row(cause.effect, cause.target, f"{cause.confidence:.3f}")
            for i, (name, value) in enumerate(cause.parameters.items()):
                head = (
                    (cause.effect, cause.target, f"{cause.confidence:.3f}") if i == 0 else ("",) * 3
                )
                unit = "" if value.unit == "1" else value.unit
                table.add_row(*head, f"{name} {value.value:.5g}", f"{value.std:.2g}", unit)
        out.print(table)
        for name in dict.fromkeys(cause.effect for cause in found.causes):
            out.print(f"  {name}: {effect_class(name).meaning}")
    for each in differences(found):
        out.print(f"  these data cannot tell it from {in_words(each)}")
    helped = (
        "would explain it, but is not claimed" if found.note else "helped, but is not the cause"
    )
    for effect, target in found.leads:
        out.print(f"  {helped}: {effect} of {target}")
    gain = found.gain
    if gain is not None:
        count = len(gain.held_out_records)
        kept = f"{count} record" if count == 1 else f"{count} records"
        share = "" if gain.explained is None else f"; {100 * gain.explained:.1f} % explained"
        out.print(
            f"On {kept} held out the residual falls from "
            f"{100 * gain.baseline_nrmse:.3g} % to {100 * gain.extended_nrmse:.3g} % of the "
            f"signal; noise alone is {100 * gain.noise_floor_nrmse:.3g} %{share}."
        )
    if life is not None:
        _show_life(life)
        others = life.get("alternatives") or ()
        for pairs, other in zip(found.alternatives, others, strict=False):
            names = " and ".join(f"{effect} of {target}" for effect, target in pairs)
            told = other.get("why") or (
                f"rivets {format_count(other['rivets_to_failure'])}, "
                f"utilisation {100 * other['utilisation']:.4g} %"
            )
            out.print(f"  with {names} instead: {told}")
        if others:
            out.print("  until the sets are told apart, only the worst of these may be promised")
        elif found.alternatives:
            out.print(
                '  "after" is with the cause named above; with another of the sets the life is '
                "another: until they are told apart, neither may be promised"
            )
    ask = found.next_measurement
    if ask:
        direction = ", ".join(f"{c:.2f}" for c in ask.get("direction", ()))
        pose = ", ".join(f"{name} {value:.2f}" for name, value in ask.get("pose", {}).items())
        out.print(f"Measure next: {ask['why']}", highlight=False)
        if pose:
            out.print(f"  pose {pose}; force along ({direction}), {ask.get('force', 0):g} N")


def _show_life(life: Mapping[str, Any]) -> None:
    from rich.table import Table

    from picchio.cli.output import console
    from picchio.studies.assessment.result import format_count

    table = Table(box=None, pad_edge=False, header_style="dim", title="Life", title_justify="left")
    for name in ("joint", "rivets before", "after", "utilisation before %", "after %"):
        table.add_column(name, justify="left" if name == "joint" else "right")

    def rivets(joint: Mapping[str, Any]) -> str:
        return format_count(joint["rivets_to_failure"])

    def used(joint: Mapping[str, Any]) -> str:
        return f"{100 * joint['utilisation']:.4g}"

    def between(joint: Mapping[str, Any], key: str, show: Callable[[float], str]) -> str:
        """The interval, where it says more than the value."""
        low, high = (show(end) for end in joint.get(key, (math.nan, math.nan)))
        return "" if low == high else f"[dim]{low} to {high}[/dim]"

    before, after = life["baseline"]["joints"], life["extended"]["joints"]
    for name, old in before.items():
        sides = (old, after[name])
        table.add_row(name, *map(rivets, sides), *map(used, sides))
        spans = [between(side, "rivets_interval", format_count) for side in sides]
        spans += [
            between(side, "utilisation_interval", lambda u: f"{100 * u:.4g}") for side in sides
        ]
        if any(spans):
            table.add_row("", *spans)
    out = console()
    out.print(table)
    if "interval_level" in life:
        out.print(
            f"  [dim]{100 * life['interval_level']:g} % intervals: before, of the stated "
            "tolerance; after, of what was fitted. The material's scatter is not in them (picchio "
            "assess --uncertainty)[/dim]"
        )


# What `picchio diagnose` does with motion records.


@dataclass(frozen=True)
class MotionAnswer:
    """A diagnosis of motion records, and what it says of blows.

    Attributes:
        diagnosis: the answer.
        carried: which causes act while the tool hits.
        life: what they do to the task's life.
    """

    diagnosis: Diagnosis
    carried: BlowEffects
    life: MotionLife

    @property
    def notes(self) -> str:
        """What a model's file says of causes that it does not hold."""
        head = "found by picchio diagnose in motion records"
        why: dict[str, list[str]] = {}
        for effect, reason in self.carried.left:
            names = why.setdefault(reason, [])
            name = f"{effect.name} of {effect.target}"
            if name not in names:
                names.append(name)
        said = [f"{', '.join(names)}: {reason}" for reason, names in why.items()]
        return f"{head}; found as well, and not in this model: {'; '.join(said)}" if said else head

    def extra(self) -> dict[str, Any]:
        """Keys that JSON has beside the contract's."""
        blows = {side: dict(joints) for side, joints in self.life.blows.items()}
        return {"life_note": self.life.why, "blows": blows or None}

    def page(
        self, campaign: Campaign, model_toml: str, command: str, warnings: Sequence[str]
    ) -> str:
        """The report."""
        from picchio.visuals.report.motion_diagnosis import motion_diagnosis_report

        return motion_diagnosis_report(
            self.diagnosis,
            life=self.life,
            carried=self.carried,
            model_toml=model_toml if self.diagnosis.causes else "",
            command=command,
            folder=None if campaign.folder is None else campaign.folder.name,
            warnings=warnings,
        )


def diagnose_motion_records(
    robot: FlexibleRobot, campaign: Campaign, without: Sequence[str], task: Path | None
) -> MotionAnswer:
    """Diagnose, and follow the task's blows before and after.

    Args:
        robot: the nominal robot.
        campaign: its motion records.
        without: effects that must not be considered.
        task: for the life; the robot's own if None.

    Raises:
        InputError: as `diagnose_motion`; a bad task that was asked for.
    """
    from picchio.cli.output import progress
    from picchio.diagnosis.motion.conclude.during_blows import (
        MotionLife,
        effects_during_blows,
        motion_life,
    )
    from picchio.diagnosis.motion.diagnosis import diagnose_motion
    from picchio.studies.tasks import load_task

    with progress("diagnosis") as report:
        found = diagnose_motion(robot, campaign, without=without, progress=report)
    path = task or robot.task_path
    try:
        work = load_task(path, robot) if path is not None else None
        life = motion_life(robot, work, found)
    except InputError as error:
        if task is not None:
            raise
        life = MotionLife(None, f"the life could not be computed: {error}")
    return MotionAnswer(found, effects_during_blows(found), life)


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
    from picchio.campaign.campaign import load_campaign
    from picchio.cli.output import check_target, console, said_warnings, write_json
    from picchio.core.files import atomic_write
    from picchio.core.provenance import provenance
    from picchio.model.effects.registry import effect_class
    from picchio.robot.loading.load import load_robot
    from picchio.studies.tasks import load_task

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
    from picchio.visuals.report.diagnosis import diagnosis_report
    from picchio.visuals.scene.diagnosed import diagnosis_scene

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
    from picchio.diagnosis.percussion.diagnosis import diagnose_percussion

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
    from picchio.studies.tasks import load_task

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
    from picchio.robot.loading.saved_model import saved_model_text

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
