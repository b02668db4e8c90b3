"""`picchio assess`: the main job, the life of every joint on a task."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from picchio.cli.options import (
    FlexOption,
    GravityStiffnessOption,
    JsonOption,
    RobotArgument,
    ToolOption,
)
from picchio.core.errors import InputError

if TYPE_CHECKING:
    from picchio.studies import Assessment, JointLife, OperationResult

# Below this a torque in N m or an angle in mrad is rounding, and is printed as 0.
_ROUNDING = 1e-9

EPILOG = "Example: picchio assess fanuc_like_3dof --method paper --json life.json"


def register(app: typer.Typer) -> None:
    """Add the subcommand."""
    app.command(epilog=EPILOG)(assess)


def assess(
    robot: RobotArgument,
    task: Annotated[
        Path | None,
        typer.Option("--task", metavar="FILE", help="Task (TOML); the robot's own if not given."),
    ] = None,
    flex: FlexOption = None,
    tool: ToolOption = None,
    method: Annotated[
        str, typer.Option(help="rainflow: each rivet from rest, counted. paper: Nie et al. 2016.")
    ] = "rainflow",
    sn_curve: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="S-N curve for all joints: a name or a TOML file."),
    ] = None,
    residue: Annotated[
        str, typer.Option(help="Rainflow residue: half-cycles, repeated or discarded.")
    ] = "half-cycles",
    mean_stress: Annotated[
        str, typer.Option(help="Mean stress correction: none, goodman, gerber, ...")
    ] = "none",
    paper_mean_stress: Annotated[
        bool,
        typer.Option("--paper-mean-stress", help="Paper: life at the mean of the poses' stresses."),
    ] = False,
    gravity_stiffness: GravityStiffnessOption = False,
    json: JsonOption = None,
) -> None:
    """How many rivets each joint of a robot survives on a task."""
    from picchio.cli.output import progress, write_json
    from picchio.fatigue.mean_stress import RULES
    from picchio.fatigue.rainflow import RESIDUE_RULES
    from picchio.robot import load_robot
    from picchio.studies import assess as run
    from picchio.studies import load_task

    for key, value, choices in (
        ("--method", method, ("rainflow", "paper")),
        ("--residue", residue, RESIDUE_RULES),
        ("--mean-stress", mean_stress, RULES),
    ):
        if value not in choices:
            raise InputError("unknown choice", key=key, value=value, choices=choices)
    loaded = load_robot(robot, flex=flex, tool=tool)
    path = task or loaded.task_path
    if path is None:
        raise InputError(
            f"{loaded.name} has no example task of its own",
            key="--task",
            hint="give one: a TOML file of the format picchio-task/1",
        )
    work = load_task(path, loaded)
    with progress("poses") as report:
        found = run(
            loaded,
            work,
            method=method,  # type: ignore[arg-type]
            sn_curve=sn_curve,
            residue=residue,  # type: ignore[arg-type]
            mean_stress=mean_stress,  # type: ignore[arg-type]
            paper_mean_stress=paper_mean_stress,
            gravity_stiffness=gravity_stiffness,
            progress=report,
        )
    if json is not None:
        write_json(found.to_dict(), json)
    if json != "-":
        show(found, path)


def show(found: Assessment, task: Path) -> None:
    """Print an assessment for people."""
    from picchio.cli.output import console

    out = console()
    passes = sum(len(op.poses) * op.rivets for op in found.operations)
    out.print(f"[bold]{found.robot}[/bold] on {task.name}: {_plural(passes, 'rivet')} a pass")
    for blows in dict.fromkeys(_blows(operation) for operation in found.operations):
        out.print(f"  {blows}")
        for operation in found.operations:
            if _blows(operation) == blows:
                x, y, z = operation.direction
                out.print(
                    f"    {operation.name}: {_plural(len(operation.poses), 'pose')}, force along "
                    f"({x:.3g}, {y:.3g}, {z:.3g})"
                )
    out.print()
    out.print(_life_table(found))
    out.print(f"[bold]{verdict(found)}[/bold]\n")
    if len(found.operations) > 1 and any(joint.damage_share for joint in found.joints):
        out.print(_share_table(found))
    if found.steady_state:
        out.print(_steady_table(found))
    out.print("[dim]How this was computed[/dim]")
    for line in found.assumptions:
        out.print(f"[dim]  - {line}[/dim]")


def verdict(found: Assessment) -> str:
    """The result in a sentence."""
    if found.limiting_joint is None:
        return (
            "No joint has a shaft or a reducer, so no life can be told; give them in the sidecar."
        )
    joint = next(j for j in found.joints if j.name == found.limiting_joint)
    if math.isfinite(joint.life):
        return f"The robot survives {_count(joint.life)} rivets; {joint.name} fails first."
    over = [j.name for j in found.joints if j.reducer_utilisation > 1.0]
    if over:
        return (
            f"Blows and gravity exceed the torque limits of the reducer in {', '.join(over)}: no "
            "life can be promised there."
        )
    part = f"reducer {joint.reducer}" if joint.reducer_utilisation > joint.utilisation else "shaft"
    if not joint.sn_curve:
        part = f"reducer {joint.reducer}"
    shafts = any(j.sn_curve for j in found.joints)
    first = "No shaft fails: every stress stays below its endurance limit. " if shafts else ""
    return (
        f"{first}The {part} of {joint.name} comes closest, at "
        f"{100 * joint.governing_utilisation:.3g} % of its allowable."
    )


def _life_table(found: Assessment) -> Any:
    shafts = [joint for joint in found.joints if joint.sn_curve]
    torques = len(shafts) < len(found.joints)
    columns = {
        "peak\ndeflection\nmrad": lambda j: _number(j.peak_deflection * 1e3),
        **({"peak\ntorque\nN m": lambda j: _number(j.peak_torque)} if torques else {}),
        **({"gravity\ntorque\nN m": lambda j: _number(j.gravity_torque)} if torques else {}),
    }
    reducer = {
        "reducer\nused\n%": lambda j: _number(100 * j.reducer_utilisation),
    }
    if not any(joint.reducer for joint in found.joints):
        reducer = {}
    if not shafts:
        columns |= reducer
    else:
        columns |= {
            "peak\nstress\nMPa": lambda j: _number(j.peak_shear_stress / 1e6),
            "gravity\nstress\nMPa": lambda j: _number(j.gravity_shear_stress / 1e6),
            "utili-\nsation\n%": lambda j: _number(100 * j.utilisation),
            **reducer,
            "damage\na rivet\n": lambda j: f"{j.damage_per_rivet:.4g}",
            "rivets to\nfailure\n": lambda j: _life(j),
        }
    table = _table(
        "Life of the joints" if shafts else "The joints",
        ("joint", "left"),
        *((name, "right") for name in columns),
        ("worst at", "left"),
    )
    slides = [joint.name for joint in found.joints if joint.kind == "prismatic"]
    if slides:
        table.caption = f"{', '.join(slides)} slides: mm and N, not mrad and N m"
        table.caption_justify = "left"
    for joint in found.joints:
        weakest = joint.name == found.limiting_joint
        table.add_row(
            joint.name,
            *(cell(joint) for cell in columns.values()),
            f"{joint.worst_operation}, pose {joint.worst_pose + 1}",
            style="bold" if weakest else None,
        )
    return table


def _share_table(found: Assessment) -> Any:
    names = [operation.name for operation in found.operations]
    table = _table(
        "Share of each joint's damage, %", ("joint", "left"), *((name, "right") for name in names)
    )
    for joint in found.joints:
        shares = [joint.damage_share.get(name) for name in names]
        table.add_row(joint.name, *("-" if s is None else f"{100 * s:.3g}" for s in shares))
    return table


def _steady_table(found: Assessment) -> Any:
    table = _table(
        "The paper's steady state against a rivet as it happens\n(the paper's S-N curve on both)",
        ("joint", "left"),
        ("steady\npeak\nmrad", "right"),
        ("rivet's\npeak\nmrad", "right"),
        ("\nratio\n", "right"),
        ("rivets,\nsteady, one\ncycle a hit", "right"),
        ("rivets,\nfrom rest,\ncounted", "right"),
        ("\nratio\n", "right"),
    )
    for check in found.steady_state:
        table.add_row(
            check.joint,
            _number(check.steady_peak * 1e3),
            _number(check.rest_peak * 1e3),
            _number(check.peak_ratio),
            _count(check.paper_life),
            _count(check.counted_life),
            _number(check.life_ratio),
        )
    return table


def _table(title: str, *columns: tuple[str, str]) -> Any:
    from rich import box
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    table.title_style = "bold"
    for header, justify in columns:
        table.add_column(header, justify=justify, no_wrap=True)  # type: ignore[arg-type]
    return table


def _life(joint: JointLife) -> str:
    return "unknown" if not joint.sn_curve else _count(joint.rivets_to_failure)


def _number(value: float) -> str:
    if math.isnan(value):
        return "-"
    return "0" if abs(value) < _ROUNDING else f"{value:.4g}"


def _count(value: float) -> str:
    if math.isnan(value):
        return "-"
    if math.isinf(value):
        return "no end"
    # Four digits are more than the physics deserves.
    return f"{float(f'{value:.4g}'):,.0f}" if value < 1e12 else f"{value:.3e}"


def _blows(operation: OperationResult) -> str:
    return f"{_plural(operation.hits_per_rivet, 'hit')} a rivet: {operation.excitation}"


def _plural(count: float, noun: str) -> str:
    return f"{count:g} {noun}" + ("" if count == 1 else "s")
