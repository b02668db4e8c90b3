"""`picchio reproduce`: the paper behind the method, claim by claim."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from picchio.cli.options import JsonOption

if TYPE_CHECKING:
    from picchio.paper.run import Reproduction

EPILOG = "Example: picchio reproduce --report paper.html"


def register(app: typer.Typer) -> None:
    """Add the subcommand."""
    app.command(epilog=EPILOG)(reproduce)


def reproduce(
    report: Annotated[
        Path | None, typer.Option("--report", metavar="OUT.html", help="One page to read.")
    ] = None,
    assume: Annotated[
        list[str] | None,
        typer.Option(
            "--assume", metavar="NAME=VALUE", help="Change what the paper leaves open; repeatable."
        ),
    ] = None,
    worlds: Annotated[
        int | None, typer.Option(help="How many other sets of assumptions a claim is tried in.")
    ] = None,
    json: JsonOption = None,
) -> None:
    """Recompute the figures, tables and claims of Nie et al. 2016, and say which hold."""
    import picchio
    from picchio.cli.output import check_target, command_line, progress, said_warnings, write_json
    from picchio.paper.assumptions import parse_assumptions
    from picchio.paper.printed import paper_file
    from picchio.paper.study import WORLDS

    for target in (report, json):
        check_target(target, [paper_file()])
    given = parse_assumptions(assume or [])
    with progress("hypotheses about Table 2") as told:
        found = picchio.reproduce(given, worlds=WORLDS if worlds is None else worlds, progress=told)
    if report is not None:
        page = picchio.report(found, command=command_line(), warnings=said_warnings())
        page.save(report)
    if json is not None:
        write_json(found.to_dict(), json)
    if json != "-":
        _show(found, report)


def _show(found: Reproduction, report: Path | None) -> None:
    from rich.table import Table

    from picchio.cli.output import console

    screen = console()
    printed = found.study.printed
    screen.print(f"[bold]{printed.title}[/bold]\n{printed.journal}\n", highlight=False)
    table = Table(box=None, pad_edge=False, show_edge=False)
    for name, options in (
        ("p.", {"justify": "right"}), ("claim", {"max_width": 48}), ("verdict", {"max_width": 60}),
    ):  # fmt: skip
        table.add_column(name, **options)  # type: ignore[arg-type]
    colour = {"holds": "green", "holds only if": "yellow", "does not hold": "red",
              "cannot be known": "dim"}  # fmt: skip
    for tried in found.claims:
        mark = str(tried.finding.verdict)
        table.add_row(
            str(tried.sentence.page),
            tried.sentence.quote.replace("[", r"\["),
            f"[{colour[mark]}]{mark}[/] {tried.finding.condition}".replace("[joint", r"\[joint"),
        )
    screen.print(table)
    counts = ", ".join(f"{n} {verdict}" for verdict, n in found.counts.items())
    screen.print(f"\n{len(found.claims)} claims: {counts}.")
    answer = found.answer
    low, high = answer.table.over_printed.min(), answer.table.over_printed.max()
    screen.print(
        f"Table 2's lives are {low:.3g} to {high:.3g} times shorter than the printed curve's; "
        f"S = {answer.curve.values['a']:,.0f} N^{answer.curve.values['b']:.4f} at the same mean "
        f"stresses gives seven of eight within {100 * answer.within:.2g} %."
    )
    if report is not None:
        screen.print(f"The page: {report}")
