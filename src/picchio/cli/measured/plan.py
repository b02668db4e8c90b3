"""`picchio plan`: which tests of stiffness narrow the life most."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from picchio.cli import options as typed
from picchio.cli import output
from picchio.cli.app import app

if TYPE_CHECKING:
    from picchio.diagnosis.planning.plan import PlannedTests


@app.command()
def plan(
    given: typed.RobotGiven,
    *,
    task: typed.TaskOption = None,
    budget: str = "20min",
    instruments: Annotated[str, typer.Option("--with")] = "scale,dial",
    force: float | None = None,
    to: Annotated[Path | None, typed.folder("--to")] = None,
    overwrite: bool = False,
    seed: Annotated[int, typer.Option(min=0)] = 0,
    report: typed.ReportOption = None,
    json: typed.JsonOption = None,
) -> None:
    """The tests for stiffness that narrow the life on a task most.

    Poses, directions and places of the instruments, until the time is up or one more would not
    change the answer. With --flex the sidecar of an earlier `picchio identify` the plan goes on
    from what is known.

    Options:
        budget (TIME): The time there is, such as 20min, 1h or 900s.
        instruments (NAMES): Instruments at hand: scale or weight with dial or tracker; hammer with
            accelerometer.
        force (N): How hard to pull; as the task's blows, at most 400.
        to (FOLDER): Where the campaign goes: a form to fill in, plan.toml, sheet.html to print.
        overwrite: Write over a form that is there, filled in or not.
        seed (N): Random seed of the poses.
    """
    import picchio
    from picchio.studies.default_task import task_of

    hands = [name.strip() for name in instruments.split(",") if name.strip()]
    with output.notice_first(json):
        loaded = given.load()
    work = task_of(loaded, task)
    with output.telling("planning") as say:
        found = picchio.plan(
            loaded, work, budget=budget, instruments=hands, force=force, seed=seed, progress=say
        )
    if to is not None:
        found.save(to, overwrite=overwrite)
        output.write_report(found, to / "sheet.html")
    output.write_report(found, report)
    output.deliver(found.to_dict(), json, lambda: _show(found, to))


def _show(found: PlannedTests, to: Path | None) -> None:
    from picchio.diagnosis.planning.kind import along, angles

    out = output.console()
    out.print(output.styled(f"{found._headline()}."))
    rows, before = [], None
    for k, record in enumerate(found.records, start=1):
        one = record.candidate
        told = ""
        if one.place != before:
            told = ", ".join(f"{value:.4g}" for value, _ in angles(found.robot, one.pose).values())
        before = one.place
        reads = "x, y, z" if one.reads is None else along(one.reads)
        reads += f" on {one.frame}" if one.frame else ""
        load = f"{one.force:.3g} N" if one.kind == "static" else "hit"
        rows.append([str(k), told, f"{load} {along(one.direction)}", reads,
                     f"{record.seconds / 60.0:.1f}"])  # fmt: skip
    if rows:
        out.print(output.table(("", "pose, deg or mm", "load", "read along", ">min"), rows))
    if to is not None:
        out.print("Fill in the form, then:")
        out.print(output.styled(f"  {found.next_command(str(to))}"), soft_wrap=True)
    out.print(f"No more records: {found.choice.why}.")
    out.print(output.listed(found._factors()))
    for note in found.notes:
        out.print(f"  - {note}")
