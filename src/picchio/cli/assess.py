"""`picchio assess`: the main job, the life of every joint on a task."""

from __future__ import annotations

import math
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from picchio.cli.options import (
    FlexOption,
    GravityStiffnessOption,
    JsonOption,
    RobotArgument,
    SNCurveOption,
    TaskOption,
    ToolOption,
)
from picchio.cli.output import console
from picchio.core.errors import InputError
from picchio.studies.assessment.result import format_count, verdict

if TYPE_CHECKING:
    from picchio.robot.flexible_robot import FlexibleRobot
    from picchio.studies.assessment.method_comparison import Term
    from picchio.studies.assessment.result import Assessment, JointLife, OperationResult
    from picchio.studies.backwards import Allowable
    from picchio.studies.tasks import Task
    from picchio.studies.uncertainty import UncertainLife


# What `picchio assess` prints for people.

# Below this a torque in N m or an angle in mrad is rounding, and is printed as 0.
_ROUNDING = 1e-9


def show(found: Assessment, task: Path, terms: tuple[Term, ...] = ()) -> None:
    """Print an assessment."""
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
    if any(joint.reducer for joint in found.joints):
        out.print(_reducer_table(found))
        for line in found.reducer_warnings:
            out.print(f"  {line}", markup=False)
        out.print()
    out.print(f"[bold]{verdict(found)}[/bold]\n")
    if len(found.operations) > 1 and any(joint.damage_share for joint in found.joints):
        out.print(_share_table(found))
    if found.steady_state:
        out.print(_steady_table(found))
    if terms:
        out.print(_terms_table(terms))
    out.print("[dim]How this was computed[/dim]")
    for line in found.assumptions:
        out.print(f"[dim]  - {line}[/dim]")


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
            "damage\na rivet\n": lambda j: f"{j.damage_per_rivet:.4g}" if j.sn_curve else "-",
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


def _reducer_table(found: Assessment) -> Any:
    table = _table(
        "The reducers",
        ("joint", "left"),
        ("reducer", "left"),
        ("used, %", "right"),
        ("the limit that binds", "left"),
    )
    for joint in found.joints:
        if joint.reducer:
            used = _number(100 * joint.reducer_utilisation)
            table.add_row(joint.name, joint.reducer, used, joint.reducer_governed_by or "-")
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
    lives = any(not math.isnan(check.paper_life) for check in found.steady_state)
    table = _table(
        "The paper's steady state against a rivet as it happens\n(largest over the task"
        + ("; the paper's S-N curve on both)" if lives else ")"),
        ("joint", "left"),
        ("steady\npeak\nmrad", "right"),
        ("rivet's\npeak\nmrad", "right"),
        ("\nratio\n", "right"),
        *(
            (
                ("rivets,\nsteady, one\ncycle a hit", "right"),
                ("rivets,\nfrom rest,\ncounted", "right"),
                ("\nratio\n", "right"),
            )
            if lives
            else ()
        ),
    )
    for check in found.steady_state:
        cells = [
            _number(check.steady_peak * 1e3),
            _number(check.rest_peak * 1e3),
            _number(check.peak_ratio),
        ]
        if lives:
            cells += [
                format_count(check.paper_life),
                format_count(check.counted_life),
                _number(check.life_ratio),
            ]
        table.add_row(check.joint, *cells)
    return table


def _terms_table(terms: tuple[Term, ...]) -> Any:
    table = _table(
        "How far the paper's method is from the default one, an assumption at a time",
        ("term", "left"),
        ("rivets to\nfailure", "right"),
        ("times the\nlife of", "right"),
        ("", "left"),
        ("what changes", "left"),
    )
    for term in terms:
        factor = f"{term.factor:.3g}" if math.isfinite(term.factor) else ""
        table.add_row(
            term.name,
            format_count(term.rivets_to_failure),
            factor,
            term.against if factor else "",
            term.what,
        )
    return table


def show_allowable(found: tuple[Allowable, ...], task: Task) -> None:
    """Print what a wanted life allows."""
    out = console()
    sure = "" if found[0].survival is None else f", survival {found[0].survival:g}"
    table = _table(
        f"What a life of {format_count(found[0].rivets)} rivets{sure} allows",
        ("joint", "left"),
        ("rivets\nas it is", "right"),
        ("force\ntimes", "right"),
        ("hits\na rivet", "right"),
        ("shaft radius\nat least, mm", "right"),
    )
    for joint in found:
        force = "no end" if math.isinf(joint.force_factor) else f"{joint.force_factor:.4g}"
        hits = "no end" if joint.hits is None else str(joint.hits)
        radius = f"{joint.radius * 1e3:.4g}"
        table.add_row(joint.joint, format_count(joint.life), force, hits, radius)
    out.print(table)
    factor = min(joint.force_factor for joint in found)
    if math.isfinite(factor):
        forces = ", ".join(
            f"{op.name} {factor * op.excitation.peak_force:.4g} N" for op in task.operations
        )
        out.print(f"Allowable force of the blows, all alike: {forces}.\n")


def show_spread(found: UncertainLife) -> None:
    """Print how sure the lives are."""
    out = console()
    names = list(found.inputs)
    table = _table(
        "How sure the life is: rivets that 90, 50 and 10 % exceed, and where the doubt is from, %",
        ("", "left"),
        ("P10", "right"),
        ("P50", "right"),
        ("P90", "right"),
        *((name.replace("_", "\n"), "right") for name in names),
    )
    for name, spread in {**found.joints, "robot": found.robot}.items():
        lives = [format_count(value) for value in (spread.p10, spread.p50, spread.p90)]
        shares = [f"{100 * max(spread.totals[key], 0.0):.0f}" for key in names]
        table.add_row(name, *lives, *shares)
    out.print(table)
    for line in found.assumptions:
        out.print(f"[dim]  - {line}[/dim]")


def _table(title: str, *columns: tuple[str, str]) -> Any:
    from rich import box
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
    table.title_style = "bold"
    for header, justify in columns:
        table.add_column(header, justify=justify, no_wrap=True)  # type: ignore[arg-type]
    return table


def _life(joint: JointLife) -> str:
    return "unknown" if not joint.sn_curve else format_count(joint.rivets_to_failure)


def _number(value: float) -> str:
    if math.isnan(value):
        return "-"
    return "0" if abs(value) < _ROUNDING else f"{value:.4g}"


def _blows(operation: OperationResult) -> str:
    return f"{_plural(operation.hits_per_rivet, 'hit')} a rivet: {operation.excitation}"


def _plural(count: float, noun: str) -> str:
    return f"{count:g} {noun}" + ("" if count == 1 else "s")


EPILOG = "Example: picchio assess fanuc_like_3dof --method paper --json life.json"


def register(app: typer.Typer) -> None:
    """Add the subcommand."""
    app.command(epilog=EPILOG)(assess)


def assess(
    robot: RobotArgument,
    task: TaskOption = None,
    flex: FlexOption = None,
    tool: ToolOption = None,
    method: Annotated[
        str, typer.Option(help="rainflow: each rivet from rest, counted. paper: Nie et al. 2016.")
    ] = "rainflow",
    sn_curve: SNCurveOption = None,
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
    for_life: Annotated[
        float | None,
        typer.Option("--for-life", metavar="N", help="Asked backwards: what N rivets allow."),
    ] = None,
    survival: Annotated[
        float | None,
        typer.Option(metavar="P", help="Probability of survival for --for-life, such as 0.99."),
    ] = None,
    uncertainty: Annotated[
        bool, typer.Option("--uncertainty", help="Life as P10, P50, P90 (takes a minute).")
    ] = False,
    seed: Annotated[int | None, typer.Option(help="Of --uncertainty; 0 if not given.")] = None,
    compare_methods: Annotated[
        bool,
        typer.Option("--compare-methods", help="The paper's method against this one, by terms."),
    ] = False,
    gravity_stiffness: GravityStiffnessOption = False,
    gravity_balanced: Annotated[
        bool,
        typer.Option("--gravity-balanced", help="Gravity leaves no torque in the joints."),
    ] = False,
    report: Annotated[
        Path | None,
        typer.Option("--report", metavar="OUT.html", help="A report to print and to mail."),
    ] = None,
    json: JsonOption = None,
) -> None:
    """How many rivets each joint of a robot survives on a task."""
    from picchio.cli.inputs import task_file
    from picchio.cli.output import check_target, progress, said_warnings, write_json
    from picchio.core.files import atomic_write
    from picchio.fatigue.counting.counter import RESIDUE_RULES
    from picchio.fatigue.mean_stress import RULES
    from picchio.robot.loading.load import load_robot
    from picchio.studies.assessment.run import assess as run
    from picchio.studies.backwards import allowable
    from picchio.studies.tasks import load_task
    from picchio.studies.uncertainty import uncertain_life
    from picchio.visuals.report.assessment import assessment_report

    for key, value, choices in (
        ("--method", method, ("rainflow", "paper")),
        ("--residue", residue, RESIDUE_RULES),
        ("--mean-stress", mean_stress, RULES),
    ):
        if value not in choices:
            raise InputError("unknown choice", key=key, value=value, choices=choices)
    _check_options(
        method, residue, mean_stress, paper_mean_stress, for_life, survival, uncertainty, seed
    )
    for target in (json, report):
        check_target(target, [robot, task, flex, sn_curve])
    loaded = load_robot(robot, flex=flex, tool=tool)
    path = task_file(loaded, task)
    work = load_task(path, loaded)
    for target in (json, report):
        check_target(target, [*loaded.files, *work.files])
    with progress("poses") as tick:
        found = run(
            loaded,
            work,
            method=method,  # type: ignore[arg-type]
            sn_curve=sn_curve,
            residue=residue,  # type: ignore[arg-type]
            mean_stress=mean_stress,  # type: ignore[arg-type]
            paper_mean_stress=paper_mean_stress,
            gravity_stiffness=gravity_stiffness,
            gravity_balanced=gravity_balanced,
            progress=tick,
        )
    content = found.to_dict()
    terms = _terms(loaded, work, found) if compare_methods or report is not None else ()
    if terms:
        content["method_terms"] = [term.to_dict() for term in terms]
    options: dict[str, Any] = {
        "sn_curve": sn_curve,
        "residue": residue,
        "mean_stress": mean_stress,
        "gravity_stiffness": gravity_stiffness,
        "gravity_balanced": gravity_balanced,
    }
    allowed = spread = None
    if for_life is not None:
        allowed = allowable(loaded, work, for_life, survival=survival, **options)
        content |= allowed.to_dict()
    if uncertainty:
        with progress("samples") as tick:
            spread = uncertain_life(loaded, work, seed=seed or 0, progress=tick, **options)
        content["uncertainty"] = spread.to_dict()
    if report is not None:
        page = assessment_report(
            found,
            loaded,
            work,
            warnings=said_warnings(),
            command=" ".join(["picchio", *map(shlex.quote, sys.argv[1:])]),
            gravity_stiffness=gravity_stiffness,
            sn_curve=sn_curve,
            allowed=() if allowed is None else allowed.joints,
            spread=spread,
            terms=terms,
        )
        with atomic_write(report) as stream:
            stream.write(page)
    if json is not None:
        write_json(content, json)
    if json != "-":
        show(found, path, terms)
        if allowed is not None:
            show_allowable(allowed.joints, work)
        if spread is not None:
            show_spread(spread)


def _terms(robot: FlexibleRobot, task: Task, found: Assessment) -> tuple[Term, ...]:
    """The way from the paper's method to the default, where there is one."""
    from picchio.fatigue.sn.library import DEFAULT_SN_CURVE, load_sn_curve
    from picchio.studies.assessment.method_comparison import compare_methods

    known = any(joint.sn_curve for joint in found.joints)
    damped = all(math.isfinite(check.rest_peak + check.steady_peak) for check in found.steady_state)
    return compare_methods(robot, task, load_sn_curve(DEFAULT_SN_CURVE)) if known and damped else ()


def _check_options(
    method: str,
    residue: str,
    mean_stress: str,
    paper_mean_stress: bool,
    for_life: float | None,
    survival: float | None,
    uncertainty: bool,
    seed: int | None,
) -> None:
    """Refuse options that would be ignored, and numbers out of range."""
    rainflow_only = {
        "--for-life": for_life,
        "--residue": None if residue == "half-cycles" else residue,
        "--mean-stress": None if mean_stress == "none" else mean_stress,
        "--uncertainty": uncertainty or None,
    }
    for key, given in rainflow_only.items():
        if method != "rainflow" and given is not None:
            raise InputError("belongs to the method rainflow", key=key, value=given)
    if paper_mean_stress and method != "paper":
        raise InputError("belongs to --method paper", key="--paper-mean-stress", value=True)
    if survival is not None and for_life is None:
        raise InputError("belongs to --for-life", key="--survival", value=survival)
    if survival is not None and not 0.0 < survival < 1.0:
        raise InputError("must lie between 0 and 1", key="--survival", value=survival)
    if for_life is not None and not (math.isfinite(for_life) and for_life > 0):
        raise InputError("must be a positive number of rivets", key="--for-life", value=for_life)
    if seed is not None and not uncertainty:
        raise InputError("belongs to --uncertainty", key="--seed", value=seed)
    if seed is not None and seed < 0:
        raise InputError("must not be negative", key="--seed", value=seed)
