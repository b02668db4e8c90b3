"""The report's plots, each with an alt text that says what it shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from picchio.fatigue import SNCurve, shear_stress
from picchio.model import Model
from picchio.robot import FlexibleRobot
from picchio.studies import Assessment
from picchio.studies.envelope import direction_envelope
from picchio.studies.uncertainty import UncertainLife
from picchio.view.plots import (
    plot_counted_cycles,
    plot_damage,
    plot_force_spectrum,
    plot_force_train,
    plot_life_spread,
    plot_mode_shapes,
    plot_polar_envelope,
    plot_response,
    plot_sn_curve,
    plot_stress_history,
    plot_utilisation,
)
from picchio.view.plots.response import response_times
from picchio.view.plots.style import blank_figure
from picchio.view.report.svg import inline_svg
from picchio.view.worst import WorstRivet


@dataclass(frozen=True)
class Figure:
    """An inline SVG, its caption, and whether it opens the report or is folded away."""

    svg: Markup
    caption: str
    main: bool


def report_figures(
    assessment: Assessment,
    robot: FlexibleRobot,
    worst: WorstRivet,
    curve: SNCurve | None,
    *,
    gravity_stiffness: bool,
    spread: UncertainLife | None = None,
) -> list[Figure]:
    """All plots of an assessment report, the most telling first."""
    made: list[Figure] = []

    def add(ax: object, alt: str, caption: str, *, main: bool = False) -> None:
        made.append(Figure(inline_svg(ax, alt, f"f{len(made)}"), caption, main))  # type: ignore[arg-type]

    joint, operation = worst.joint, worst.operation
    where = f"{operation.name}, pose {worst.pose_number}"
    slides = joint.kind == "prismatic"
    unit, spoken = ("mm", "millimetres") if slides else ("mrad", "milliradians")
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
    if spread is not None:
        add(plot_life_spread(spread, blank_figure(height=1.1 + 0.36 * (joints + 1))),
            "Lives that 90, 50 and 10 percent of the possible worlds exceed, by joint",
            "From P10 to P90, the dot is the median; what was varied stands below.",
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
        at, stress = worst.stress_turning_points()
        response = worst.response
        last = float(response.force.start[-1])
        time = response_times(
            response, last * 2.6 if not response.periodic else 2 * response.force.end
        )
        history = shear_stress(
            worst.stiffness * response.deflection(time, operation.direction)[worst.index],
            joint.shaft,
        )
        add(plot_stress_history(time, history, blank_figure(height=2.7),
                                turning_points=(at, stress), joint=joint.name,
                                static=float(shear_stress(worst.static_torque, joint.shaft)),
                                allowable=curve.allowable),
            f"Shear stress in the shaft of {joint.name} over its worst rivet",
            f"What rainflow counts: the turning points of the stress ({where}).")  # fmt: skip
        add(plot_counted_cycles(worst.cycles(), blank_figure(height=2.7),
                                allowable=curve.allowable, joint=joint.name),
            f"Cycles counted in the worst rivet of {joint.name}, by amplitude",
            "How many cycles of this rivet reach each amplitude.")  # fmt: skip
    add(plot_force_train(operation.excitation, blank_figure(height=2.3)),
        f"Force of the tool over three blows: {operation.excitation.describe()}",
        f"The blows of the operation {operation.name}.")  # fmt: skip
    modes = worst.modes.natural_frequencies
    add(plot_force_spectrum(operation.excitation, blank_figure(height=2.3),
                            natural_frequencies=modes),
        "Amplitude of the harmonics of the blows, with the robot's natural frequencies at "
        + ", ".join(f"{f:.3g}" for f in modes) + " hertz",
        f"The blows' harmonics and the robot's modes ({where}).")  # fmt: skip
    add(plot_mode_shapes(worst.modes, blank_figure(height=2.7)),
        "Which joints move in each mode of the robot",
        f"The modes of the robot ({where}).")  # fmt: skip
    envelope = direction_envelope(
        Model(robot, gravity_stiffness), worst.pose, operation.excitation,
        None if worst.rest is None else operation.hits_per_rivet,
    )  # fmt: skip
    for plane in ("xz", "xy"):
        add(plot_polar_envelope(envelope, plane, blank_figure(5.6, 3.9, polar=True), count=72),  # type: ignore[arg-type]
            f"Peak deflection of every joint by the direction of the force in the {plane} plane",
            f"What the force's direction changes, in the {plane} plane ({where}).",
            main=plane == "xz")  # fmt: skip
    return made


def _ranking(assessment: Assessment) -> str:
    shafts = [j for j in assessment.joints if j.sn_curve or j.reducer]
    if shafts:
        return ", ".join(f"{j.name} {100 * j.governing_utilisation:.3g} percent" for j in shafts)
    return ", ".join(f"{j.name} {j.peak_torque:.3g} newton metres" for j in assessment.joints)
