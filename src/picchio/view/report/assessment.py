"""From an assessment to one self-contained HTML file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from importlib.resources import files

from picchio.fatigue import SNCurve, load_sn_curve
from picchio.robot import FlexibleRobot
from picchio.studies import Assessment, Task
from picchio.studies.backwards import Allowable
from picchio.studies.method_terms import Term
from picchio.studies.uncertainty import UncertainLife
from picchio.studies.verdict import format_count, verdict
from picchio.view.report.figures import report_figures
from picchio.view.worst import worst_rivet


def assessment_report(
    assessment: Assessment,
    robot: FlexibleRobot,
    task: Task,
    *,
    warnings: Sequence[str] = (),
    command: str | None = None,
    gravity_stiffness: bool = False,
    sn_curve: str | SNCurve | None = None,
    scene: str | None = None,
    allowed: Sequence[Allowable] = (),
    spread: UncertainLife | None = None,
    terms: Sequence[Term] = (),
) -> str:
    """The report of an assessment: verdict, table, plots, method, origins, how to reproduce.

    The page needs nothing from outside, prints on A4 or Letter, and follows the reader's light
    or dark theme. Every name is escaped.

    Args:
        assessment: of this robot on this task.
        robot: the robot.
        task: the task.
        warnings: what was warned of while loading and assessing, a sentence each.
        command: the command line that gave this, to reproduce it.
        gravity_stiffness: as in the assessment.
        sn_curve: as given to `assess`.
        scene: HTML of the 3-D scene, to be shown in the report; it adds its own size.
        allowed: what a wanted life allows, of `picchio.studies.backwards`.
        spread: how sure the lives are, of `picchio.studies.uncertainty`.
        terms: the paper's method against this one, of `picchio.studies.method_terms`.

    Returns:
        the HTML.
    """
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    worst = worst_rivet(assessment, robot, task, gravity_stiffness=gravity_stiffness)
    life = assessment.joint(worst.joint.name)
    curve = _curve(sn_curve, robot, life.sn_curve)
    figures = report_figures(
        assessment, robot, worst, curve, gravity_stiffness=gravity_stiffness, spread=spread
    )
    over_limit = any(joint.reducer_utilisation > 1.0 for joint in assessment.joints)
    folder = files("picchio.view.report")
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters.update(number=number, count=format_count, percent=percent)
    template = environment.from_string((folder / "assessment.html.j2").read_text("utf-8"))
    return template.render(
        style=Markup((folder / "style.css").read_text("utf-8")),
        a=assessment,
        robot=robot,
        task=task,
        worst=worst,
        life=life,
        curve=curve,
        figures=figures,
        headline=verdict(assessment),
        bad=math.isfinite(assessment.rivets_to_failure) or over_limit,
        reducers=any(joint.reducer for joint in assessment.joints),
        allowed=list(allowed),
        spread=spread,
        spread_rows=[*spread.joints.items(), ("robot", spread.robot)] if spread else [],
        terms=list(terms),
        shafts=any(joint.sn_curve for joint in assessment.joints),
        warnings=list(dict.fromkeys(warnings)),
        estimates=[joint.name for joint in robot.flexible_joints if joint.estimated],
        slides=any(joint.kind == "prismatic" for joint in robot.flexible_joints),
        command=command or f"picchio assess {robot.name}",
        scene=scene,
    )


def number(value: float, digits: int = 4) -> str:
    """A number with few digits; a dash where there is none."""
    if not math.isfinite(value):
        return "\N{EN DASH}" if math.isnan(value) else "no end"
    # Below this it is rounding.
    return "0" if abs(value) < 1e-9 else f"{value:.{digits}g}"


def percent(value: float) -> str:
    """A share as a percentage without its sign."""
    return number(100.0 * value, 3)


def _curve(given: str | SNCurve | None, robot: FlexibleRobot, name: str) -> SNCurve | None:
    """The curve that the assessment calls by this name."""
    if not name:
        return None
    if isinstance(given, SNCurve):
        return given
    of_shafts = [joint.shaft.sn_curve for joint in robot.flexible_joints if joint.shaft]
    for source in (given, *of_shafts):
        if source and (curve := load_sn_curve(source, quiet=True)).name == name:
            return curve
    return load_sn_curve(name, quiet=True)
