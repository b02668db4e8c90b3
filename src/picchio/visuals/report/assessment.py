"""From an assessment to one self-contained HTML file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from picchio.core.arrays import FloatArray
from picchio.fatigue.shaft_stress import shear_stress
from picchio.fatigue.sn.curve import SNCurve
from picchio.fatigue.sn.library import load_sn_curve
from picchio.model.model import ModelLike
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.studies.assessment.backwards import Allowable, AllowableLoads, listing_of
from picchio.studies.assessment.method_comparison import Term, terms_listing
from picchio.studies.assessment.result import Assessment
from picchio.studies.comparison import listed
from picchio.studies.envelopes import envelope
from picchio.studies.tasks import Task
from picchio.studies.uncertainty.result import UncertainLife
from picchio.visuals.plots.force import plot_force_spectrum, plot_force_train
from picchio.visuals.plots.frequency import plot_mode_shapes
from picchio.visuals.plots.life import (
    plot_damage,
    plot_life_scan,
    plot_life_spread,
    plot_utilisation,
)
from picchio.visuals.plots.polar import plot_polar_envelope
from picchio.visuals.plots.response import plot_response, response_times
from picchio.visuals.plots.sn import plot_sn_curve
from picchio.visuals.plots.stress import plot_counted_cycles, plot_rivet_stress
from picchio.visuals.plots.style import blank_figure
from picchio.visuals.report.cover import Cover
from picchio.visuals.report.page import Picture, inline_svg, render
from picchio.visuals.report.trace import Trace, traces_html
from picchio.visuals.scene.portrait import plot_robot
from picchio.visuals.worst_rivet import WorstRivet, worst_rivet

_LITTLE = 0.02  # of the variance: the same as on a terminal
_DRAWN = 6000  # samples of a plot that zooms, at most

# The report's plots, each with an alt text that says what it shows.


def _figures(
    assessment: Assessment, worst: WorstRivet, curve: SNCurve | None, spread: UncertainLife | None
) -> dict[str, list[Picture]]:
    """All plots of an assessment report: "main" ones open it, "more" are folded away."""
    made: dict[str, list[Picture]] = {"main": [], "more": []}

    def add(ax: Axes, alt: str, caption: str, *, main: bool = False) -> None:
        svg = inline_svg(ax, alt, f"f{sum(map(len, made.values()))}")
        made["main" if main else "more"].append(Picture(svg, caption))

    joint, operation = worst.joint, worst.operation
    where = f"{operation.name}, pose {worst.pose_number}"
    unit, spoken = joint.units.small, joint.units.spoken
    joints, operations = len(assessment.joints), len(assessment.operations)
    shafts = any(j.sn_curve or j.reducer for j in assessment.joints)
    tall = 0.9 + 0.3 * joints * (1 + 0.5 * (operations - 1))
    add(
        plot_utilisation(assessment, blank_figure(height=tall)),
        ("Largest load over the allowable" if shafts else "Largest torque")
        + " of every joint in every operation: " + _ranking(assessment),
        "The largest value over the poses of each operation; reducers, where known, as diamonds."
        + ("" if shafts else " No shaft or reducer is known, so torques stand in."),
        main=True,
    )  # fmt: skip
    if any(j.damage_per_rivet > 0 for j in assessment.joints):
        add(plot_damage(assessment, blank_figure(height=1.1 + 0.34 * joints)),
            "Damage a rivet does to every joint, by operation",
            "Miner's sum of one rivet, the mean over the task; at a sum of 1 the joint fails.",
            main=True)  # fmt: skip
    if spread is not None and spread.robot.endless < 1.0:
        add(plot_life_spread(spread, blank_figure(height=1.1 + 0.36 * (joints + 1))),
            "Lives that 90, 50 and 10 percent of the possible worlds exceed, by joint",
            "From P10 to P90, the dot is the median; what was varied stands below.",
            main=True)  # fmt: skip
    if spread is not None:
        for name, scan in spread.scans.items():
            add(plot_life_scan(name, scan, blank_figure(height=2.7)),
                f"Life of the robot against a factor on {name}: it falls and rises again",
                f"A larger {name} does not always make the life longer, nor shorter: the blows "
                "excite a mode. Everything else is as stated; where the line breaks, the life has "
                "unlimited.",
                main=True)  # fmt: skip
    if worst.rest is not None:
        peak = worst.rest.peaks(operation.direction)[worst.index].value
        add(
            plot_response(worst.rest, operation.direction, blank_figure(height=2.9),
                          joints=[joint.name], steady=worst.steady, unit=unit),
            f"Deflection of {joint.name} over a rivet of {operation.hits_per_rivet} hits: up to "
            f"{abs(peak) * 1e3:.3g} {spoken}, then a ring-down",
            f"{joint.name} in its worst rivet ({where}). The band is where the "
            "steady state would lie.",
            main=True,
        )  # fmt: skip
    if joint.shaft is not None and curve is not None:
        amplitudes = {
            j.name: np.concatenate([op.utilisation[:, k] for op in assessment.operations])
            * curve.allowable
            for k, j in enumerate(assessment.joints)
            if j.sn_curve == curve.name
        }
        add(plot_sn_curve(curve, blank_figure(height=3.0), amplitudes=amplitudes),
            f"S-N curve {curve.name} with the largest amplitude of every pose, a symbol a joint",
            "Each symbol is one pose of the task at its largest equivalent amplitude; at the "
            "right edge it could go on for ever.", main=True)  # fmt: skip
        add(plot_rivet_stress(worst, blank_figure(height=2.7), allowable=curve.allowable),
            f"Shear stress in the shaft of {joint.name} over its worst rivet",
            f"What rainflow counts: the turning points of the stress ({where}).")  # fmt: skip
        add(plot_counted_cycles(worst.cycles(), blank_figure(height=2.7),
                                allowable=curve.allowable, joint=joint.name),
            f"Cycles counted in the worst rivet of {joint.name}, by amplitude",
            "How many cycles of this rivet reach each amplitude.")  # fmt: skip
    model = worst.rivet.model
    told = "" if not model.changes_blows else ", with the model's effects in them"
    add(plot_force_train(operation.excitation, blank_figure(height=2.3), model=model),
        f"Force of the tool over three blows: {operation.excitation.describe()}",
        f"The blows of the operation {operation.name}{told}.")  # fmt: skip
    modes = worst.modes.natural_frequencies
    add(plot_force_spectrum(operation.excitation, blank_figure(height=2.3),
                            natural_frequencies=modes,
                            model=None if worst.steady is None else model),
        "Amplitude of the harmonics of the blows, with the robot's natural frequencies at "
        + ", ".join(f"{f:.3g}" for f in modes) + " hertz",
        f"The blows' harmonics and the robot's modes ({where}).")  # fmt: skip
    add(plot_mode_shapes(worst.modes, blank_figure(height=2.7)),
        "Which joints move in each mode of the robot",
        f"The modes of the robot ({where}).")  # fmt: skip
    if worst.rivet.nonlinear:  # no closed form for every direction
        return made
    balls = envelope(model, worst.pose, operation.excitation,
                     hits=None if worst.rest is None else operation.hits_per_rivet)  # fmt: skip
    for plane in ("xz", "xy"):
        add(plot_polar_envelope(balls, plane, blank_figure(5.6, 3.9, polar=True), count=72),  # type: ignore[arg-type]
            f"Peak deflection of every joint by the direction of the force in the {plane} plane",
            f"What the force's direction changes, in the {plane} plane ({where}).",
            main=plane == "xz")  # fmt: skip
    return made


def _traces(worst: WorstRivet, robot: FlexibleRobot) -> list[Trace]:
    """Every joint's deflection over the worst rivet, the worst joint's first."""
    response, along = worst.response, worst.operation.direction
    last = float(response.force.start[-1])
    end = 2.0 * float(response.force.end) if response.periodic else 3.0 * last
    if worst.rest is not None:
        end = max(end, last + 4.0 / max(-float(response.modes.poles.real.max()), 1.0))
    time = response_times(response, end)
    time = time[:: -(-len(time) // _DRAWN)]
    values = response.deflection(time, along)
    lines: dict[str, FloatArray] = {"steady state" if response.periodic else "from rest": values}
    if worst.steady is not None and not response.periodic:
        lines["steady state"] = worst.steady.deflection(time, along)
    made = []
    where = f"{worst.operation.name}, pose {worst.pose_number}"
    order = sorted(range(len(robot.flexible_joints)), key=lambda j: j != worst.index)
    for j in order:
        joint = robot.flexible_joints[j]
        made.append(Trace(
            where, f"deflection of {joint.name}",
            joint.units.small, time, {name: 1e3 * every[j] for name, every in lines.items()},
        ))  # fmt: skip
        if joint.shaft is not None:
            stress = {name: shear_stress(worst.rivet.stiffness[j] * every[j], joint.shaft) / 1e6
                      for name, every in lines.items()}  # fmt: skip
            what = f"stress in the shaft of {joint.name}"
            made.append(Trace(where, what, "MPa", time, stress))
    return made


def _portrait(assessment: Assessment, robot: FlexibleRobot, worst: WorstRivet) -> Picture:
    """The robot where the governing part fares worst."""
    where = f"{worst.operation.name}, pose {worst.pose_number}"
    axes = plot_robot(robot, worst.pose, assessment, blank_figure(4.6, 3.6))
    alt = f"The robot {robot.name} with the rivets of the task, at {where}"
    return Picture(inline_svg(axes, alt, "robot"), f"{robot.name} at its worst rivet ({where}); "
                   "arrows: the force on the robot.")  # fmt: skip


def _materials(
    assessment: Assessment, robot: FlexibleRobot, given: str | SNCurve | None
) -> list[SNCurve]:
    """The S-N curves behind the result."""
    names = dict.fromkeys(joint.sn_curve for joint in assessment.joints)
    return [curve for name in names if (curve := _curve(given, robot, name)) is not None]


def _ranking(assessment: Assessment) -> str:
    shafts = [j for j in assessment.joints if j.sn_curve or j.reducer]
    if shafts:
        return ", ".join(f"{j.name} {100 * j.governing_utilisation:.3g} percent" for j in shafts)
    return ", ".join(f"{j.name} {j.peak_torque:.3g} newton metres" for j in assessment.joints)


def assessment_report(
    assessment: Assessment,
    robot: ModelLike,
    task: Task,
    *,
    warnings: Sequence[str] = (),
    command: str | None = None,
    gravity_stiffness: bool | None = None,
    sn_curve: str | SNCurve | None = None,
    scene: str | None = None,
    allowed: Sequence[Allowable] | AllowableLoads = (),
    spread: UncertainLife | None = None,
    terms: Sequence[Term] = (),
    cover: Cover | None = None,
) -> str:
    """The report of an assessment: verdict, table, plots, method, origins, how to reproduce.

    The page needs nothing from outside, prints on A4 or Letter, and follows the reader's light
    or dark theme. Every name is escaped.

    Args:
        assessment: of this robot on this task.
        robot: the robot, or a model of it.
        task: the task.
        warnings: what was warned of while loading and assessing, a sentence each.
        command: the command line that gave this, to reproduce it.
        gravity_stiffness: as in the assessment.
        sn_curve: as given to `assess`.
        scene: HTML of the 3-D scene, to be shown in the report; it adds its own size.
        allowed: what a wanted life allows, of `picchio.studies.assessment.backwards`.
        spread: how sure the lives are, of `picchio.studies.uncertainty`.
        terms: the paper's method against this one, of `method_comparison`.
        cover: title, customer, author and logo, for the first page.

    Returns:
        the HTML.

    Raises:
        InputError: a logo that is no picture.
    """
    worst = worst_rivet(assessment, robot, task, gravity_stiffness=gravity_stiffness)
    robot = worst.rivet.model.robot
    life = assessment.joint(worst.joint.name)
    curve = _curve(sn_curve, robot, life.sn_curve)
    told = assessment.verdict
    loads = {joint.name: joint.units.load for joint in assessment.joints}
    answer = allowed if isinstance(allowed, AllowableLoads) else None
    varied = sorted(spread.inputs, key=lambda n: -spread.robot.shares[n]) if spread else []
    unvaried = [name for name in varied if spread and spread.robot.shares[name] < _LITTLE]
    return render(
        "assessment.html.j2",
        a=assessment,
        verdict=told,
        robot=robot,
        task=task,
        life=life,
        joints=assessment._listing(),
        curve=curve,
        figures=_figures(assessment, worst, curve, spread),
        traces=traces_html(_traces(worst, robot), "The worst rivet, joint by joint"),
        headline=told.headline,
        tone=told.status,
        cover=cover or Cover(),
        picture=_portrait(assessment, robot, worst),
        entered=listed(assessment.inputs),
        materials=_materials(assessment, robot, sn_curve),
        reducers=any(joint.reducer for joint in assessment.joints),
        allowed=listing_of(list(allowed), loads, answer.held if answer else None)
        if allowed
        else None,
        answer=answer,
        spread=spread,
        varied=[name for name in varied if name not in unvaried],
        unvaried=unvaried,
        spread_rows=[*spread.joints.items(), ("robot", spread.robot)] if spread else [],
        terms=terms_listing(terms) if terms else None,
        shafts=any(joint.sn_curve for joint in assessment.joints),
        warnings=[
            line
            for line in dict.fromkeys([*told.reasons, *warnings])
            if line not in (assessment.notice, assessment.task_note)
        ],
        units=Counter(joint.units for joint in assessment.joints).most_common(1)[0][0],
        command=command or f"picchio assess {robot.name}",
        scene=scene,
    )


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
