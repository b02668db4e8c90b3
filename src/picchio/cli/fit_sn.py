"""`picchio fit-sn`: an S-N curve from test data, run-outs included."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from picchio.cli.options import JsonOption
from picchio.core.errors import InputError

if TYPE_CHECKING:
    from picchio.fatigue.sn.fit import Estimate, SNFit

_PICTURES = (".png", ".svg", ".pdf")
EPILOG = "Example: picchio fit-sn tests.csv --survival 0.99 --out my-steel.toml --plot fit.png"


def register(app: typer.Typer) -> None:
    """Add the subcommand."""
    app.command("fit-sn", epilog=EPILOG)(fit_sn_command)


def fit_sn_command(
    tests: Annotated[
        Path,
        typer.Argument(
            metavar="TESTS.csv",
            help="Columns such as `Stress [MPa]`, `Cycles`, `Comment` (Failure, RunOut).",
            show_default=False,
        ),
    ],
    survival: Annotated[float, typer.Option(help="Of the design strength.")] = 0.975,
    level: Annotated[float, typer.Option(help="Of the two-sided confidence intervals.")] = 0.90,
    kind: Annotated[
        str, typer.Option(help="What the stress is: shear, or normal (bending, axial).")
    ] = "shear",
    run_out_cycles: Annotated[
        float | None, typer.Option(help="Without an outcome column: run-outs reached this.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Write the curve as TOML, for --sn-curve."),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option("--plot", metavar="FILE", help="Draw tests and curve: .png, .svg or .pdf."),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Fit slope, knee, endurance limit and scatter, each with its interval."""
    import picchio
    from picchio.cli.output import check_target, write_json
    from picchio.fatigue.sn.library import write_sn_curve

    for target in (out, plot, json):
        check_target(target, [tests])
    if plot is not None and plot.suffix.lower() not in _PICTURES:
        raise InputError("unknown kind", key="--plot", value=plot.name, choices=_PICTURES)
    found = picchio.fit_sn(
        tests, kind=kind, survival=survival, level=level, run_out_cycles=run_out_cycles
    )
    if out is not None:
        write_sn_curve(found.curve(survival, name=out.stem), out)
    if plot is not None:
        from picchio.visuals.plots.sn import plot_sn_fit
        from picchio.visuals.plots.style import blank_figure, save_figure

        save_figure(plot_sn_fit(found, blank_figure(height=3.8)), plot)
    if json is not None:
        write_json(found.to_dict(), json)
    if json != "-":
        _show(found, tests)


def _show(found: SNFit, tests: Path) -> None:
    from rich import box
    from rich.table import Table

    from picchio.cli.output import console

    screen = console()
    screen.print(f"[bold]{tests.name}[/bold]: {found.failures} failures, {found.run_outs} run-outs")
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("")
    table.add_column("value", justify="right")
    table.add_column(f"{100 * found.level:g} % interval", justify="right")
    at = f"at {found.reference_cycles:.3g} cycles"
    limit = (
        "endurance limit in shear, median, MPa"
        if found.knee
        else f"strength in shear {at}, median, MPa"
    )
    rows: list[tuple[str, Estimate, float, str]] = [
        ("slope", found.slope, 1.0, ".3g"),
        *([("knee, cycles", found.knee, 1.0, ".3g")] if found.knee else []),
        (limit, found.endurance_limit, 1e-6, ".4g"),
        (f"the same, survival {found.design_survival:g}, MPa", found.design, 1e-6, ".4g"),
        ("scatter of log10 strength", found.scatter, 1.0, ".3g"),
    ]
    for name, value, factor, spec in rows:
        low, high = (format(end * factor, spec) for end in (value.low, value.high))
        table.add_row(name, format(value.value * factor, spec), f"{low} to {high}")
    screen.print(table)
    for line in found.assumptions:
        screen.print(f"[dim]  - {line}[/dim]")
