"""`picchio place`: where to put the work so that the robot lasts longest."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from picchio.cli.options import (
    FlexOption,
    JsonOption,
    RobotArgument,
    SNCurveOption,
    TaskOption,
    ToolOption,
)
from picchio.core.errors import InputError

if TYPE_CHECKING:
    from picchio.studies.placement.result import Placement

EPILOG = "Example: picchio place fanuc_like_3dof --move 0.3,0.3,0.3,30 --out moved.toml"


def register(app: typer.Typer) -> None:
    """Add the subcommand."""
    app.command(epilog=EPILOG)(place)


def place(
    robot: RobotArgument,
    task: TaskOption = None,
    move: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,Z,HEADING",
            help="m, m, m, deg: how far the work may go each way, 0 for not at all. "
            "By default half the arm's reach, and 180.",
        ),
    ] = None,
    period_range: Annotated[
        str | None,
        typer.Option(metavar="LOW,HIGH", help="s, the periods the gun can be set to."),
    ] = None,
    margin: Annotated[
        float, typer.Option(help="m, that the work may stand beside and still be reached.")
    ] = 0.0,
    off: Annotated[
        float, typer.Option(help="m: what it costs to stand so far beside the best place.")
    ] = 0.05,
    placements: Annotated[
        int, typer.Option(help="How many within reach to try all over before going local.")
    ] = 400,
    flex: FlexOption = None,
    tool: ToolOption = None,
    sn_curve: SNCurveOption = None,
    self_collision: Annotated[
        bool,
        typer.Option(
            "--self-collision/--no-self-collision", help="Refuse poses whose links touch."
        ),
    ] = True,
    seed: Annotated[int, typer.Option(help="Of the search.")] = 0,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Write the task with the work moved (TOML)."),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Where to put the work, with which poses and hit rate, so that the robot lasts longest."""
    from picchio.cli.inputs import numbers, task_file
    from picchio.cli.output import check_numbers, check_target, progress, write_json
    from picchio.robot.loading.load import load_robot
    from picchio.studies.placement.file import write_task
    from picchio.studies.placement.run import place as run
    from picchio.studies.placement.work import Work
    from picchio.studies.tasks import load_task

    for target in (json, out):
        check_target(target, [robot, task, flex, sn_curve])
    check_numbers(margin=margin, off=off)
    if seed < 0:
        raise InputError("must not be negative", key="--seed", value=seed)
    far = None if move is None else numbers(move, "--move", 4)
    if far is not None:
        far[3] = math.radians(far[3])
    rates = None
    if period_range is not None:
        low, high = numbers(period_range, "--period-range", 2)
        rates = (low, high)
    loaded = load_robot(robot, flex=flex, tool=tool)
    path = task_file(loaded, task)
    work = load_task(path, loaded)
    for target in (json, out):
        check_target(target, [*loaded.files, *work.files])
    try:
        with progress("steps of the search") as tick:
            found = run(
                loaded, work, move=far, period_range=rates,
                placements=placements, off=off, margin=margin, sn_curve=sn_curve,
                self_collision=self_collision, seed=seed, progress=tick,
            )  # fmt: skip
    except InputError as error:
        if error.file is None and error.key in (
            "move",
            "off",
            "margin",
            "placements",
            "period-range",
        ):
            raise InputError(
                error.problem, key=f"--{error.key}", value=error.value, hint=error.hint
            ) from None
        raise
    if out is not None:
        write_task(found, Work.of(loaded, work), work, path, out)
    if json is not None:
        write_json(found.to_dict(), json)
    if json != "-":
        _show(found, off)
        if out is not None:
            print(f"The task with the work moved: {out}")


def _show(found: Placement, off: float) -> None:
    from rich import box
    from rich.table import Table

    from picchio.cli.output import console
    from picchio.studies.assessment.result import format_count

    out = console()
    # Zeros are added for the sake of their sign.
    x, y, z = found.best.spot.move[:3].round(3) + 0.0
    heading = round(math.degrees(found.best.spot.move[3]), 2) + 0.0
    out.print(
        f"[bold]{found.robot}[/bold]: {found.placements} placements tried all over, "
        f"{found.reached} of them within reach; {found.nearby} more near the best"
    )
    if found.moved:
        out.print(
            f"  work: shift by ({x:.3f}, {y:.3f}, {z:.3f}) m, turn by {heading:.2f} deg "
            "about the vertical through its middle"
        )
        bx, by, bz = found.best.base_position.round(3) + 0.0
        turned = round(math.degrees(found.best.base_heading), 2) + 0.0
        out.print(f"  or base: to ({bx:.3f}, {by:.3f}, {bz:.3f}) m, turned by {turned:.2f} deg")
        if found.best.spot.period is not None:
            out.print(f"  a blow every {1e3 * found.best.spot.period:.4g} ms")
    else:
        out.print("  nothing better than where the work is now was found")
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("joint")
    for name in ("rivets,\nnow", "utilisation,\nnow, %", "rivets,\nbest", "utilisation,\nbest, %"):
        table.add_column(name, justify="right")
    for now, then in zip(found.start.joints, found.best.joints, strict=True):
        table.add_row(
            now.name,
            format_count(now.rivets_to_failure), f"{100 * now.utilisation:.4g}",
            format_count(then.rivets_to_failure), f"{100 * then.utilisation:.4g}",
        )  # fmt: skip
    out.print(table)
    out.print(_gain(found))
    out.print(_cost_of_off(found, off))
    if found.by_effort:
        out.print("Utilisation: torque over the URDF's effort limit; no shaft or reducer is known.")
    out.print(f"Self-collisions: {found.self_collision}.")


def _gain(found: Placement) -> str:
    utilisation = f"the highest utilisation falls {found.utilisation_gain:.4g} times"
    if found.utilisation_gain < 1.0:
        utilisation = f"the highest utilisation rises {1.0 / found.utilisation_gain:.4g} times"
    if math.isnan(found.life_gain):
        return f"Gain: no life has an end; {utilisation}."
    if math.isinf(found.life_gain):
        return f"Gain: the life no longer has an end; {utilisation}."
    return f"Gain: the weakest joint lives {found.life_gain:.4g} times as long; {utilisation}."


def _cost_of_off(found: Placement, off: float) -> str:
    beside = f"{100 * off:g} cm beside the best place"
    lost = [o for o in found.off if not o.reached]
    near = [o for o in found.off if o.reached]
    parts = []
    if near:
        least = min(o.rivets_to_failure for o in near)
        if math.isfinite(least):
            share = least / found.best.rivets_to_failure
            parts.append(f"the life is at worst {share:.3g} times as long")
        most = max(o.utilisation for o in near) / max(found.best.utilisation, 1e-300)
        parts.append(f"the utilisation at worst {most:.4g} times as high")
    if lost:
        ways = ", ".join(
            f"{'+' if c > 0 else '-'}{axis}"
            for o in lost
            for axis, c in zip("xyz", o.shift, strict=True)
            if c
        )
        parts.append(f"not every rivet can be reached towards {ways} (--margin asks for room)")
    return f"{beside[0].upper()}{beside[1:]}: {'; '.join(parts)}."
