"""`picchio simulate`: the campaign that a test plan would give."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from picchio.cli import options as typed
from picchio.cli.app import app
from picchio.cli.output import console, deliver, progress

if TYPE_CHECKING:
    from picchio.prediction.simulation import Simulation


@app.command()
def simulate(
    given: typed.RobotGiven,
    *,
    plan: Path,
    to: Annotated[Path, typed.folder("--to")],
    gravity_stiffness: typed.GravityStiffnessOption = None,
    seed: Annotated[int | None, typer.Option(min=0)] = None,
    parquet: bool = False,
    overwrite: bool = False,
    json: typed.JsonOption = None,
) -> None:
    """The measured data that a test plan would give.

    The plan (see `picchio formats plan`) names poses, directions, levels, blows, sample rate and
    sensors with their noise; [[effect]] tables in it make the world differ from the model.

    Options:
        plan (PLAN.toml): The test plan.
        to (CAMPAIGN): The folder of the campaign.
        seed (N): Random seed of the noise; the plan's if not given.
        parquet: Write Parquet files instead of CSV.
        overwrite: Replace a campaign that is there.
    """
    import picchio

    loaded = given.load()
    with progress("records") as report:
        made = picchio.simulate(
            loaded,
            plan,
            to,
            robot_name=given.robot,
            seed=seed,
            gravity_stiffness=gravity_stiffness,
            parquet=parquet,
            overwrite=overwrite,
            progress=report,
        )
    deliver(made.to_dict(), json, lambda: _show(made))


def _show(made: Simulation) -> None:
    out = console()
    out.print(made._headline())
    out.print("  " + ", ".join(made.campaign.records[0].channels))
