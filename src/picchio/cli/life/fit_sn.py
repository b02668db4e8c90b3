"""`picchio fit-sn`: an S-N curve from test data, run-outs included."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from picchio.cli.app import app
from picchio.cli.options import PICTURES, JsonOption, output
from picchio.cli.output import console, deliver, listed, styled, telling

if TYPE_CHECKING:
    from picchio.fatigue.sn.fit import SNFit


@app.command()
def fit_sn(
    tests: Path,
    *,
    survival: float = 0.975,
    level: float = 0.9,
    kind: str = "shear",
    run_out_cycles: float | None = None,
    stress: str | None = None,
    stress_column: str | None = None,
    stress_unit: str | None = None,
    ratio: float | None = None,
    cycles: str | None = None,
    outcome: str | None = None,
    out: Annotated[Path | None, output("--out")] = None,
    plot: Annotated[Path | None, output("--plot", *PICTURES)] = None,
    json: JsonOption = None,
) -> None:
    """Fit an S-N curve to test data, run-outs included.

    Slope, knee, endurance limit and scatter, each with its confidence interval.

    Options:
        tests (TESTS.csv): A row a specimen: `Stress amplitude [MPa]` (or range, max and R),
            `Cycles`, `Failure` (yes or no) or `Outcome` (Failure or RunOut).
        survival (P): Probability of survival of the design curve.
        level (P): Level of the two-sided confidence intervals.
        kind (KIND): The stress of the tests: shear, or normal (bending, axial).
        run_out_cycles (N): Without an outcome column: specimens that reached N are run-outs.
        stress (KIND): What the column of stresses holds: amplitude, range or max.
        stress_column (COLUMN): The column of stresses, by its name.
        stress_unit (UNIT): Of the stresses, where their name has none: MPa, ksi.
        ratio (R): Least over largest stress, where no column says.
        cycles (COLUMN): The column of cycles, by its name.
        outcome (COLUMN): The column that says which specimens failed.
        out (FILE): Write the design curve (TOML) for --sn-curve.
        plot (FILE): Draw tests and curve: .png, .svg or .pdf.
    """
    import picchio

    with telling("fitting"):
        found = picchio.fit_sn(
            tests, kind=kind, survival=survival, level=level, run_out_cycles=run_out_cycles,
            stress=stress, stress_column=stress_column, stress_unit=stress_unit, ratio=ratio,
            cycles=cycles, outcome=outcome,
        )  # fmt: skip
    if plot is not None:
        from picchio.visuals.plots.sn import plot_sn_fit
        from picchio.visuals.plots.style import blank_figure, save_figure

        save_figure(plot_sn_fit(found, blank_figure(height=3.8)), plot)
    if out is not None:
        found.save(out)
    deliver(found.to_dict(), json, lambda: _show(found, tests))


def _show(found: SNFit, tests: Path) -> None:
    screen = console()
    screen.print(styled(tests.name, f": {found.failures} failures, {found.run_outs} run-outs"))
    screen.print(listed(found._listing(), ""))
    for line in found.assumptions:
        screen.print(f"  - {line}", style="dim")
