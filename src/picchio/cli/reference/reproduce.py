"""`picchio reproduce`: the paper behind the method, claim by claim."""

from __future__ import annotations

from typing import TYPE_CHECKING

from picchio.cli import output
from picchio.cli.app import app
from picchio.cli.options import JsonOption, ReportOption

if TYPE_CHECKING:
    from picchio.paper.run import Reproduction


@app.command()
def reproduce(
    *,
    report: ReportOption = None,
    assume: list[str] | None = None,
    worlds: int | None = None,
    json: JsonOption = None,
) -> None:
    """Which claims of the paper behind the method hold.

    Figures, tables and claims of Nie et al. (2016) are computed again. What the paper does not
    report is assumed; a claim that depends on it is tried with many sets of assumptions.

    Options:
        assume (NAME=VALUE): Set an input that the paper does not report; may be repeated.
        worlds (N): Random sets of the unreported inputs to try each claim with.
    """
    import picchio
    from picchio.paper.study import WORLDS
    from picchio.paper.world import parse_assumptions

    given = parse_assumptions(assume or [])
    with output.progress("hypotheses about Table 2") as told:
        found = picchio.reproduce(given, worlds=WORLDS if worlds is None else worlds, progress=told)
    output.write_report(found, report)
    output.deliver(found.to_dict(), json, lambda: _show(found))


def _show(found: Reproduction) -> None:
    screen = output.console()
    printed = found.study.printed
    screen.print(f"{found._headline()}.", style="bold")
    lives = found.study.curve_of_table
    values, longer = lives.other.values, lives.over_printed
    screen.print(
        f"Table 2's lives are {longer.min():.3g} to {longer.max():.3g} times shorter than the "
        f"printed curve's; S = {values['a']:,.0f} N^{values['b']:.4f} at the same mean stresses "
        f"gives seven of eight within {lives.within:.2g} %."
    )
    screen.print(f"{printed.title}, {printed.journal}")
    colour = {"holds": "green", "holds only if": "yellow", "does not hold": "red",
              "cannot be known": "dim"}  # fmt: skip
    rows = []
    for tried in found.claims:
        mark = str(tried.verdict)
        told = output.styled(mark, f" {tried.condition or ''}", style=colour[mark])
        rows.append((told, str(tried.page), tried.quote))
    screen.print(output.table(("verdict", ">p.", "claim"), rows, ruled=False))
