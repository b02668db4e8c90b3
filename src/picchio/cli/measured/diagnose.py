"""`picchio diagnose`: what the simulation gets wrong, why, the extended model, the gain."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from picchio.cli import options as typed
from picchio.cli import output
from picchio.cli.app import app
from picchio.core import spoken
from picchio.core.files import write_text

if TYPE_CHECKING:
    from rich.text import Text

    from picchio.diagnosis.result import Diagnosis


@app.command()
def diagnose(
    given: typed.RobotGiven,
    *,
    data: typed.DataOption,
    task: Path | None = None,
    without: list[str] | None = None,
    train: list[str] | None = None,
    held_out: list[str] | None = None,
    model: Annotated[Path | None, typed.output("--model", ".toml")] = None,
    report: typed.ReportOption = None,
    plan: Annotated[Path | None, typed.output("--plan")] = None,
    gravity_stiffness: typed.GravityStiffnessOption = None,
    json: typed.JsonOption = None,
) -> None:
    """What a simulation gets wrong about measured data, and why.

    The nominal model is fitted within the campaign's tolerance. What it cannot explain is compared
    with every effect that picchio knows; whole poses are held out to judge the gain. It is said
    what the data cannot tell, what to measure to know it, and what the causes do to the life.

    Options:
        task (FILE): Task whose life is told before and after; the robot's example if not given.
        without (EFFECT): Leave an effect out, see `picchio effects`; may be repeated.
        train (RECORD): Motion record to fit to; may be repeated.
        held_out (RECORD): Motion record to judge by; may be repeated.
        model (OUT.toml): Write the extended model; every command takes it as ROBOT.
        plan (OUT.toml): Write what to measure next, for `picchio simulate`.
    """
    import picchio
    from picchio.model.effects.registry import effect_class

    for name in without or ():
        effect_class(name)
    campaign = picchio.load_campaign(data)
    moves = {record.kind for record in campaign} == {"motion"}
    given.load(allow_rigid=moves)
    with output.telling("reading the data") as say:
        found = picchio.diagnose(
            given.robot,
            campaign,
            task=task,
            without=without or (),
            flex=given.flex,
            tool=given.tool,
            gravity_stiffness=gravity_stiffness,
            train=train or (),
            held_out=held_out or (),
            progress=say,
        )
    if model is not None:
        write_text(model, found.model_text(model.parent))
    output.write_report(found, report, folder=None if model is None else model.parent)
    if plan is not None and found.plan is not None:
        write_text(plan, found.plan)
    output.deliver(found.to_dict(), json, lambda: show_diagnosis(found, plan))


# What is said of a cause that percussion and motion records could both show.
_STATUS = {
    "both": "percussion and motion records agree",
    "percussion": "by the percussion records; the motion records cannot see it",
    "motion": "by the motion records; the percussion records cannot see it",
    "drive": "by the motion records; it acts in the drive (motors assumed locked under blows)",
}


def show_diagnosis(found: Diagnosis, plan: Path | None = None) -> None:
    """Print verdict, causes, gain, life and what to measure next, for which a plan was asked."""
    from picchio.diagnosis.result import differences, in_tolerances, in_words
    from picchio.model.effects.registry import effect_class

    out = output.console()
    out.print(output.styled(f"{found.answer}."))
    gain = found.gain
    if gain is not None:
        where = f"On {output.count_of(len(gain.held_out_records), 'record')} held out"
        if not gain.held_out_records:
            where = "Nothing was held out; on what was fitted"
        out.print(f"{where} {gain.told}.")
    if found.life is not None:
        _show_life(found.life)
    ask = found.next_measurement
    if ask:
        out.print(f"Measure next: {ask['why']}", highlight=False)
    if found.causes:
        rows = []
        for cause in found.causes:
            heads = [cause.effect, cause.target, f"{cause.confidence:.3f}"]
            values = [
                [f"{name} {v.value:.5g}", f"{v.std:.2g}", "" if v.unit == "1" else v.unit]
                for name, v in cause.parameters.items()
            ]
            # The cause is named in its first row alone.
            rows += [heads + (values or [[]])[0], *(["", "", "", *row] for row in values[1:])]
        columns = ("cause", "where", "confidence", ">value", ">std", "unit")
        out.print(output.table(columns, rows, ruled=False, head_style="dim"))
        for name in dict.fromkeys(cause.effect for cause in found.causes):
            out.print(f"  {name}: {effect_class(name).meaning}")
        for cause in found.causes:
            if cause.tolerances is not None:
                out.print(f"  {cause.effect} of {cause.target}: {in_tolerances(cause)}")
    for each in differences(found):
        out.print(f"  these data cannot tell it from {in_words(each)}")
    helped = (
        "would explain it, but is not claimed" if found.note else "helped, but is not the cause"
    )
    for effect, target in found.leads:
        out.print(f"  {helped}: {effect} of {target}")
    for head, told in (
        ("not recorded", found.extra.get("not_recorded", {})),
        ("not looked for", found.not_looked_for),
    ):
        for why in dict.fromkeys(told.values()):
            names = ", ".join(name for name, reason in told.items() if reason == why)
            out.print(f"  {head}: {names} ({why})")
    if found.remainder is not None:
        out.print(f"  {found.remainder.told}")
    if found.told_without:
        out.print(f"{found.told_without}.")
    _show_channels(found.extra.get("channels") or ())
    for told in found.shared:
        if told["status"] in _STATUS:
            out.print(f"  {told['effect']} of {told['target']}: {_STATUS[told['status']]}")
    if found.life is not None:
        _show_what_to_mend(found.life)
        _show_other_lives(found, found.life.get("alternatives") or ())
    if ask:
        direction = ", ".join(f"{c:.2f}" for c in ask.get("direction", ()))
        pose = ", ".join(f"{name} {value:.2f}" for name, value in ask.get("pose", {}).items())
        if pose:
            out.print(
                f"Measure next at pose {pose}; force along ({direction}), {ask.get('force', 0):g} N"
            )
    if found.life_note:
        out.print(f"Life: {found.life_note}.")
    if plan is not None and found.plan is None:
        out.print(f"Nothing to measure next that a plan could say: {plan} not written.")


def _show_channels(told: Sequence[Mapping[str, Any]]) -> None:
    """What is left in every channel of a motion, on records held out."""
    if told:
        rows = [
            [row["channel"], *(f"{row[key]:.3g}" for key in ("before", "after", "noise")),
             row["verdict"]]
            for row in told
        ]  # fmt: skip
        columns = ("left in (RMS, SI)", ">before", ">after", ">noise", "verdict")
        output.console().print(output.table(columns, rows, ruled=False, head_style="dim"))


def _show_life(life: Mapping[str, Any]) -> None:
    def between(joint: Mapping[str, Any], key: str, show: Callable[[float], str]) -> Text | str:
        """The interval, where it says more than the value."""
        low, high = (show(end) for end in joint.get(key, (math.nan, math.nan)))
        return "" if low == high else output.styled(f"{low} to {high}", style="dim")

    rows = []
    for name, before in life["baseline"]["joints"].items():
        sides = (before, life["extended"]["joints"][name])
        lives = [spoken.count(side["rivets_to_failure"]) for side in sides]
        rows.append([name, *lives, *(spoken.per_cent(side["utilisation"]) for side in sides)])
        spans = [between(side, "rivets_interval", spoken.count) for side in sides]
        spans += [between(side, "utilisation_interval", spoken.per_cent) for side in sides]
        if any(spans):
            rows.append(["", *spans])
    columns = ("joint", ">rivets before", ">after", ">utilisation before %", ">after %")
    out = output.console()
    out.print(output.table(columns, rows, ruled=False, head_style="dim", title="Life"))
    if "interval_level" in life:
        out.print(
            f"  {100 * life['interval_level']:g} % intervals. Before: all that has a tolerance "
            "may be off. After: as far as the records leave that open, and bursts differ. The "
            "material's scatter is not in them: picchio assess --uncertainty has it",
            style="dim",
        )


def _show_what_to_mend(life: Mapping[str, Any]) -> None:
    """What each of several causes does to the life."""
    from picchio.diagnosis.life import matters

    for place, row in enumerate(life.get("causes") or ()):
        what = f"{row['effect']} of {row['target']}"
        if not matters(row, life):
            output.console().print(f"  {what} does not change the life")
            continue
        told = row.get("why") or (
            f"rivets {spoken.count(row['rivets_to_failure'])}, "
            f"utilisation {spoken.per_cent(row['utilisation'])} %"
        )
        output.console().print(f"  {'mend first ' if place == 0 else ''}{what}; after that: {told}")


def _show_other_lives(found: Diagnosis, lives: Sequence[Mapping[str, Any]]) -> None:
    """The lives with the sets of causes that the data cannot tell from those named."""
    out = output.console()
    for pairs, other in zip(found.alternatives, lives, strict=False):
        names = " and ".join(f"{effect} of {target}" for effect, target in pairs)
        instead = other.get("why") or (
            f"rivets {spoken.count(other['rivets_to_failure'])}, "
            f"utilisation {spoken.per_cent(other['utilisation'])} %"
        )
        out.print(f"  with {names} instead: {instead}")
    if lives:
        out.print("  until the sets are told apart, only the worst of these may be promised")
    elif found.alternatives:
        out.print(
            '  "after" is with the cause named above; with another of the sets the life is '
            "another: until they are told apart, neither may be promised"
        )
