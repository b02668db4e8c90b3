"""`picchio fit-sn`: an S-N curve from test data, run-outs included."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from picchio.cli.options import JsonOption
from picchio.core.errors import InputError

if TYPE_CHECKING:
    from picchio.fatigue.sn.fit import Estimate, SNFit
    from picchio.fatigue.sn.test_table import SNTests

# Distortion energy: the shear strength of ductile steel is 1 / sqrt(3) of the normal one.
_TO_SHEAR = {
    "shear": (1.0, "the tests' stresses are taken as shear (--kind)"),
    "normal": (3.0**-0.5, "normal stresses were divided by sqrt(3) to shear"),
}
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
    from picchio.cli.output import check_target, write_json
    from picchio.core.provenance import provenance
    from picchio.fatigue.sn.fit import fit_sn
    from picchio.fatigue.sn.test_table import read_sn_tests

    for target in (out, plot, json):
        check_target(target, [tests])
    if plot is not None and plot.suffix.lower() not in _PICTURES:
        raise InputError("unknown kind", key="--plot", value=plot.name, choices=_PICTURES)
    if run_out_cycles is not None and not 0.0 < run_out_cycles < float("inf"):
        raise InputError("must be positive", key="--run-out-cycles", value=run_out_cycles)
    if kind not in _TO_SHEAR:
        raise InputError("unknown", key="--kind", value=kind, choices=_TO_SHEAR)
    data = read_sn_tests(tests, run_out_cycles=run_out_cycles)
    factor, note = _TO_SHEAR[kind]
    for key, value in (("--survival", survival), ("--level", level)):
        if not 0.0 < value < 1.0:
            raise InputError("must lie between 0 and 1", key=key, value=value)
    found = fit_sn(
        factor * data.amplitude, data.cycles, data.failed, level=level, survival=survival
    )
    if out is not None:
        _write_curve(found, survival, out, note)
    if plot is not None:
        _draw(found, data, factor, plot)
    if json is not None:
        content = found.to_dict()
        content["assumptions"] = [note, *content["assumptions"], *data.assumptions]
        write_json(content | {"provenance": provenance([tests])}, json)
    if json != "-":
        _show(found, tests, (note, *data.assumptions))


def _write_curve(found: SNFit, survival: float, out: Path, note: str) -> None:
    import tomlkit

    from picchio.core.files import atomic_write
    from picchio.fatigue.sn.library import SN_FORMAT

    curve = found.curve(survival, name=out.stem)
    keys = ("name", "kind", "strength", "cycles", "slopes", "knees", "miner", "survival", "scatter")
    values = {"format": SN_FORMAT, **{key: getattr(curve, key) for key in keys}}
    values |= {"source": curve.source, "assumptions": (note, *curve.assumptions)}
    text = {k: list(v) if isinstance(v, tuple) else v for k, v in values.items()}
    with atomic_write(out) as stream:
        stream.write(tomlkit.dumps(text))


def _draw(found: SNFit, data: SNTests, factor: float, plot: Path) -> None:
    import dataclasses

    from picchio.core.files import atomic_write
    from picchio.visuals.plots.sn import plot_sn_fit
    from picchio.visuals.plots.style import PAPER, blank_figure

    shear = dataclasses.replace(data, amplitude=factor * data.amplitude)
    figure = plot_sn_fit(found, shear, blank_figure(height=3.8)).get_figure(root=True)
    assert figure is not None
    with atomic_write(plot, "wb") as stream:
        figure.savefig(stream, format=plot.suffix[1:].lower(), dpi=160, facecolor=PAPER)


def _show(found: SNFit, tests: Path, notes: tuple[str, ...]) -> None:
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
    for line in (*found.assumptions, *notes):
        screen.print(f"[dim]  - {line}[/dim]")
