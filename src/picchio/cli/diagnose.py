"""`picchio diagnose`: what the simulation gets wrong, why, the extended model, the gain."""

from __future__ import annotations

import math
import shlex
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from picchio.cli.options import FlexOption, JsonOption, RobotArgument, ToolOption

if TYPE_CHECKING:
    from picchio.diagnosis.result import Diagnosis


# What is said of a cause that percussion and motion records could both show.
_STATUS = {
    "both": "percussion and motion records agree",
    "percussion": "by the percussion records; the motion records cannot see it",
    "motion": "by the motion records; the percussion records cannot see it",
    "drive": "by the motion records; it acts in the drive, which stands still while the tool hits",
}


def show_diagnosis(found: Diagnosis) -> None:
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
    for why in dict.fromkeys(found.not_looked_for.values()):
        names = ", ".join(name for name, reason in found.not_looked_for.items() if reason == why)
        out.print(f"  not looked for: {names} ({why})")
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
    for told in found.shared:
        if told["status"] in _STATUS:
            out.print(f"  {told['effect']} of {told['target']}: {_STATUS[told['status']]}")
    life = found.life
    if life is not None:
        _show_life(life)
        others = life.get("alternatives") or ()
        for pairs, other in zip(found.alternatives, others, strict=False):
            names = " and ".join(f"{effect} of {target}" for effect, target in pairs)
            instead = other.get("why") or (
                f"rivets {format_count(other['rivets_to_failure'])}, "
                f"utilisation {100 * other['utilisation']:.4g} %"
            )
            out.print(f"  with {names} instead: {instead}")
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
    import picchio
    from picchio.cli.output import check_target, console, said_warnings, telling, write_json
    from picchio.core.files import atomic_write
    from picchio.model.effects.registry import effect_class

    outputs = (json, report, model, plan)
    for target in outputs:
        check_target(target, [robot, flex, task])
    for name in without or ():
        effect_class(name)
    campaign = picchio.load_campaign(data)
    moves = {record.kind for record in campaign} == {"motion"}
    loaded = picchio.load_robot(robot, flex=flex, tool=tool, allow_rigid=moves)
    for target in outputs:
        check_target(target, [*loaded.files, *campaign.files])
    with telling() as say:
        found = picchio.diagnose(
            robot,
            campaign,
            task=task,
            without=without or (),
            flex=flex,
            tool=tool,
            gravity_stiffness=gravity_stiffness,
            progress=say,
        )
    if model is not None:
        with atomic_write(model) as stream:
            stream.write(found.model_text(model.parent))
    if report is not None:
        command = " ".join(["picchio", *map(shlex.quote, sys.argv[1:])])
        folder = model.parent if model is not None else None
        page = picchio.report(found, command=command, warnings=said_warnings(), folder=folder)
        page.save(report)
    if plan is not None and found.plan is not None:
        with atomic_write(plan) as stream:
            stream.write(found.plan)
    if json is not None:
        write_json(found.to_dict(), json)
    if json != "-":
        show_diagnosis(found)
        if found.life_note:
            console().print(f"Life: {found.life_note}.")
        if plan is not None and found.plan is None:
            console().print(f"Nothing to measure next that a plan could say: {plan} not written.")
