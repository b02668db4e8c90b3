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
from picchio.core.errors import InputError

if TYPE_CHECKING:
    from picchio.robot import FlexibleRobot
    from picchio.studies import Assessment, Task
    from picchio.studies.method_terms import Term

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
    from picchio.cli.assess_tables import show, show_allowable, show_spread
    from picchio.cli.inputs import task_file
    from picchio.cli.output import check_target, progress, said_warnings, write_json
    from picchio.core.files import atomic_write
    from picchio.fatigue.mean_stress import RULES
    from picchio.fatigue.rainflow import RESIDUE_RULES
    from picchio.robot import load_robot
    from picchio.studies import assess as run
    from picchio.studies import load_task
    from picchio.studies.backwards import allowable
    from picchio.studies.curves import curves_of
    from picchio.studies.uncertainty import uncertain_life
    from picchio.view.report import assessment_report

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
    curves = curves_of(loaded, sn_curve)
    named = {j.name: c for j, c in zip(loaded.flexible_joints, curves, strict=True) if c}
    terms = _terms(loaded, work, found) if compare_methods or report is not None else ()
    if terms:
        content["method_terms"] = [term.to_dict() for term in terms]
    options: dict[str, Any] = {
        "residue": residue,
        "mean_stress": mean_stress,
        "gravity_balanced": gravity_balanced,
    }
    allowed = spread = None
    if for_life is not None:
        allowed = allowable(loaded, work, named, for_life, survival=survival, **options)
        content["for_life"] = [joint.to_dict() for joint in allowed]
    if uncertainty:
        with progress("samples") as tick:
            spread = uncertain_life(loaded, work, named, seed=seed or 0, progress=tick, **options)
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
            allowed=allowed or (),
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
            show_allowable(allowed, work)
        if spread is not None:
            show_spread(spread)


def _terms(robot: FlexibleRobot, task: Task, found: Assessment) -> tuple[Term, ...]:
    """The way from the paper's method to the default, where there is one."""
    from picchio.fatigue import DEFAULT_SN_CURVE, load_sn_curve
    from picchio.studies.method_terms import compare_methods

    known = any(joint.sn_curve for joint in found.joints)
    damped = all(math.isfinite(check.rest_peak) for check in found.steady_state)
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
