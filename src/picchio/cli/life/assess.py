"""`picchio assess`: the main job, the life of every joint on a task."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from picchio.cli import options as typed
from picchio.cli import output
from picchio.cli.app import app
from picchio.cli.life.how_sure import parse_spreads, show_spread
from picchio.core import spoken
from picchio.core.errors import InputError
from picchio.core.listing import Key, Listing
from picchio.core.results import plain

if TYPE_CHECKING:
    from picchio.studies.assessment.backwards import AllowableLoads
    from picchio.studies.assessment.method_comparison import Term
    from picchio.studies.assessment.result import Assessment, OperationResult
    from picchio.studies.tasks import Task


@app.command()
def assess(
    given: typed.RobotGiven,
    *,
    task: typed.TaskOption = None,
    payload: typed.PayloadOption = None,
    reach: typed.ReachOption = None,
    drive_class: typed.ClassOption = None,
    blows: typed.BlowsGiven,
    hits: Annotated[int | None, typer.Option(min=1)] = None,
    method: str = "rainflow",
    sn_curve: typed.SNCurveOption = None,
    residue: str = "half-cycles",
    mean_stress: str = "none",
    paper_mean_stress: bool = False,
    for_life: float | None = None,
    survival: float | None = None,
    uncertainty: bool = False,
    spread: list[str] | None = None,
    seed: Annotated[int | None, typer.Option(min=0)] = None,
    compare_methods: bool = False,
    gravity_stiffness: typed.GravityStiffnessOption = None,
    gravity_balanced: bool = False,
    strict: bool = False,
    report: typed.ReportOption = None,
    title: str | None = None,
    customer: str | None = None,
    author: str | None = None,
    logo: Path | None = None,
    json: typed.JsonOption = None,
) -> None:
    """How many rivets each joint of a robot survives on a task.

    Options:
        hits (N): Blows of a rivet; likewise.
        method (METHOD): rainflow: each rivet from rest, its cycles counted; paper: steady state,
            one cycle a hit (Nie et al. 2016).
        residue (RULE): What rainflow does with cycles that do not close: half-cycles, repeated or
            discarded.
        mean_stress (RULE): Mean stress correction: none, goodman, gerber, soderberg, morrow,
            walker, swt or fkm.
        paper_mean_stress: With --method paper: the life at the mean of the poses' stresses (its
            Table 2).
        for_life (N): Yes or no: does it survive N rivets? And the force, hits, shafts and reducers
            that this life allows.
        survival (P): Probability of survival for --for-life, such as 0.99.
        uncertainty: The life's P10, P50 and P90, and what they depend on; a minute.
        spread (NAME=FACTOR): How uncertain a value is, for --uncertainty: stiffness, damping_ratio,
            force, width, model, or one value such as stiffness.joint_2. Repeat it for more.
        seed (N): Random seed for --uncertainty; 0 if not given.
        compare_methods: From the paper's method to this one, step by step.
        gravity_balanced: The arm is balanced: no gravity in its joints.
        strict: Exit with 3 unless the verdict is safe, by drives that are not picchio's own
            estimate, or, with --for-life, the answer is yes.
        title (TEXT): With --report: the page's title.
        customer (TEXT): With --report: who it is for.
        author (TEXT): With --report: who it is from.
        logo (FILE): With --report: a picture, PNG, JPEG or SVG; 1 MB.
    """
    import picchio
    from picchio.studies.assessment.method_comparison import method_terms
    from picchio.studies.default_task import task_of

    # Refuse options that would be ignored, and numbers out of range.
    rainflow_only = {
        "--for-life": for_life,
        "--residue": None if residue == "half-cycles" else residue,
        "--mean-stress": None if mean_stress == "none" else mean_stress,
        "--uncertainty": uncertainty or None,
        "--spread": spread or None,
    }
    for key, value in rainflow_only.items():
        if method == "paper" and value is not None:
            raise InputError("belongs to the method rainflow", key=key, value=value)
    if survival is not None and for_life is None:
        raise InputError("belongs to --for-life", key="--survival", value=survival)
    if survival is not None and not 0.0 < survival < 1.0:
        raise InputError("must lie between 0 and 1", key="--survival", value=survival)
    if for_life is not None and not (math.isfinite(for_life) and for_life > 0):
        raise InputError("must be a positive number of rivets", key="--for-life", value=for_life)
    asked = parse_spreads(spread or ())
    uncertainty = uncertainty or bool(asked)
    if seed is not None and not uncertainty:
        raise InputError("belongs to --uncertainty", key="--seed", value=seed)
    for key, text in (("--title", title), ("--customer", customer), ("--author", author),
                      ("--logo", logo)):  # fmt: skip
        if text is not None and report is None:
            raise InputError("belongs to --report", key=key, value=str(text))
    if logo is not None:
        from picchio.visuals.report.cover import embedded

        embedded(logo)  # refused before any work
    with output.notice_first(json):
        loaded = given.load(payload=payload, reach=reach, drive_class=drive_class)
    work = task_of(loaded, task, hits=hits, **vars(blows))
    options: dict[str, Any] = {
        "sn_curve": sn_curve,
        "residue": residue,
        "mean_stress": mean_stress,
        "gravity_stiffness": gravity_stiffness,
        "gravity_balanced": gravity_balanced,
    }
    unsure = None
    if uncertainty:
        from picchio.studies.uncertainty.inputs import default_inputs

        inputs = default_inputs(work) | asked
        with output.progress("samples") as tick:
            unsure = picchio.uncertain_life(
                loaded, work, inputs=inputs, seed=seed or 0, progress=tick, **options
            )
    with output.progress("poses") as tick:
        found = picchio.assess(
            loaded,
            work,
            uncertainty=unsure or True,
            method=method,  # type: ignore[arg-type]
            paper_mean_stress=paper_mean_stress,
            progress=tick,
            **options,
        )
    content = found.to_dict(arrays=True)
    terms: tuple[Term, ...] = ()
    if compare_methods or report is not None:
        with output.telling("comparing the methods"):
            terms = method_terms(loaded, work, found)
    if terms:
        content["method_terms"] = plain(terms)
    allowed = None
    if for_life is not None:
        with output.telling("what this life allows"):
            allowed = picchio.allowable(
                loaded, work, for_life, survival=survival, reducers=given.reducers or (), **options
            )
        content |= allowed.to_dict()
    cover = None
    if report is not None:
        from picchio.visuals.report.cover import Cover

        cover = Cover(title or "", customer or "", author or "", logo)
    unsure = unsure or found.uncertainty
    if unsure is not None:
        content["uncertainty"] = unsure.to_dict()
    output.write_report(
        found,
        report,
        cover=cover,
        robot=loaded,
        task=work,
        gravity_stiffness=gravity_stiffness,
        sn_curve=sn_curve,
        allowed=allowed or (),
        spread=unsure,
        terms=terms,
    )

    def show_all() -> None:
        if allowed is not None:
            output.console().print(f"{allowed.answer}\n", style="bold")
        show(found, work, terms)
        if allowed is not None:
            _show_allowable(allowed, work, found)
        if unsure is not None:
            show_spread(unsure)

    output.deliver(content, json, show_all)
    promised = found.verdict.promised if allowed is None else allowed.yes
    if strict and not promised:
        raise typer.Exit(_NOT_SAFE)


_NOT_SAFE = 3


def show(found: Assessment, task: Task, terms: tuple[Term, ...] = ()) -> None:
    """Print an assessment: verdict, joints, then what explains them."""
    from picchio.studies.assessment.method_comparison import terms_listing

    out = output.console()
    told, allowed = found.verdict, found.allowable
    on = f" on {task.files[0].name}" if task.files else ""
    out.print(output.styled(f"{found.robot}{on}: {told.headline}"))
    if allowed is not None and allowed.told:
        out.print(allowed.told, style="bold")
    every = list(dict.fromkeys(_blows(operation) for operation in found.operations))
    whose = "" if not task.assumed else ", of its example task" if task.files else ", assumed"
    for blows in every:
        out.print(f"  {blows}{whose}; {output.count_of(task.rivets_per_pass, 'rivet')} a pass")
    out.print(output.styled("tool", f": {found.tool}"))
    for line in filter(None, (found.notice, task.note)):
        out.print(f"{line}.", style="yellow")
    out.print()
    joints = found._listing()
    if found.notice:
        order = [each.name for each in joints.columns][:-1]
    else:  # what matters most first: a narrow screen shows no more
        order = ["joint", "utilisation", "reducer", "rivets to failure", "peak stress",
                 "gravity stress", "peak deflection", "peak torque", "gravity torque",
                 "damage a rivet", "worst at"]  # fmt: skip
    out.print(output.listed(joints.only(*order)))
    for line in told.reasons:
        if line not in (found.notice, task.note):
            out.print(f"  - {line}")
    output.details()
    if any(joint.reducer for joint in found.joints):
        out.print(output.listed(found._reducers()))
    out.print("The task", style="dim")
    for operation in found.operations:
        x, y, z = operation.direction
        which = f", {_blows(operation)}" if len(every) > 1 else ""
        out.print(
            f"  {operation.name}: {output.count_of(len(operation.poses), 'pose')}, force along "
            f"({x:.3g}, {y:.3g}, {z:.3g}){which}"
        )
    if task.note:
        for k, pose in enumerate(task.operations[0].poses):
            out.print(f"  pose {k + 1}, rad (m): {', '.join(f'{q:.3g}' for q in pose)}")
    out.print()
    if len(found.operations) > 1 and any(joint.damage_share for joint in found.joints):
        out.print(output.listed(_shares(found)))
    # Of an estimated stiffness both are single cases.
    if found.steady_state and not found.notice:
        out.print(output.listed(found._steady()))
    if terms:
        out.print(output.listed(terms_listing(terms)))
    out.print("How this was computed", style="dim")
    for line in found.assumptions:
        if line not in told.reasons:
            out.print(f"  - {line}", style="dim")
    out.print()


def _shares(found: Assessment) -> Listing:
    """What each operation has of each joint's damage."""
    columns: dict[str, Key] = {"joint": "name"}
    for operation in found.operations:
        share = lambda j, name=operation.name: 100.0 * j.damage_share.get(name, math.nan)  # noqa: E731
        columns[f"{operation.name} [%]"] = share
    return Listing.of("Share of each joint's damage", found.joints, columns)


def _show_allowable(found: AllowableLoads, task: Task, life: Assessment) -> None:
    """Print what a target life allows."""
    from picchio.studies.assessment.backwards import listing_of

    out = output.console()
    loads = {joint.name: joint.units.load for joint in life.joints}
    out.print(output.listed(listing_of(found.joints, loads, found.held)))
    for key, ends in found.intervals.items():
        if not isinstance(ends, dict):
            out.print(f"In 80 % of the drawn cases the most {_MOST[key]}: {spoken.allowed(ends)}.")
    if found.held is None and math.isfinite(found.force_factor):
        forces = ", ".join(
            f"{op.name} {found.force_factor * op.excitation.peak_force:.4g} N"
            for op in task.operations
        )
        out.print(f"Allowable force of the blows, all scaled alike: {forces}.")
    for line in found.notes:
        out.print(f"  - {line}", style="dim")
    out.print()


_MOST = {"force": "force of the blows, N", "hits": "hits a rivet", "rivets": "rivets"}


def _blows(operation: OperationResult) -> str:
    return f"{output.count_of(operation.hits_per_rivet, 'hit')} a rivet: {operation.excitation}"
