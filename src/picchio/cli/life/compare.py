"""`picchio compare`: robots, guns, tasks, models or saved results side by side."""

from __future__ import annotations

from typing import TYPE_CHECKING

from picchio.cli import output
from picchio.cli.app import app
from picchio.cli.options import FlexOption, JsonOption, ReportOption, TaskOption, ToolOption
from picchio.core import spoken

if TYPE_CHECKING:
    from collections.abc import Sequence

    from picchio.studies.comparison import Comparison, Difference


@app.command()
def compare(
    items: list[str],
    *,
    task: TaskOption = None,
    robot: str | None = None,
    flex: FlexOption = None,
    tool: ToolOption = None,
    report: ReportOption = None,
    json: JsonOption = None,
) -> None:
    """What differs between robots, tasks or results.

    Robots, models, tasks and sidecars are assessed first; saved results are compared as they are.

    Options:
        items (A B ...): Robots, saved models, tasks, sidecars (a gun is in one), or JSON files that
            commands wrote.
        robot (ROBOT): The robot that tasks and sidecars are compared on.
    """
    import picchio

    with output.progress("compared") as tick:
        found = picchio.compare(*items, task=task, robot=robot, flex=flex, tool=tool, progress=tick)
    output.write_report(found, report)
    output.deliver(found.to_dict(), json, lambda: _show(found))


def _show(found: Comparison) -> None:
    out = output.console()
    if found.bottom_line:
        out.print(f"{found.bottom_line}.", style="bold")
    judged = [item for item in found.items if item.verdict]
    rows = [[item.name, *(str(item.verdict.get(key) or "-") for key in ("governed_by", "joint")),
             spoken.number(item.verdict.get("margin"))] for item in judged]  # fmt: skip
    if rows:
        out.print()
        heads = ("", "governed by", "joint", ">allowable\nover actual")
        out.print(output.table(heads, rows))
    _show_rows(found, found.figures, "What differs in the results")
    output.details()
    for item in judged:
        out.print(output.styled(item.name, f": {item.verdict['headline']}"))
    _show_rows(found, found.entered, "What differs in the inputs")
    for line in found.notes:
        out.print(f"  - {line}")


def _show_rows(found: Comparison, rows: Sequence[Difference], title: str) -> None:
    out = output.console()
    if not rows:
        out.print(f"{title}: nothing.\n")
        return
    out.print(output.listed(found._listing(rows, title)))
