"""What a simulation leaves of motion records: drives' torques and twists of the gears."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from picchio.campaign.campaign import Campaign
from picchio.campaign.channels import parse_channel
from picchio.core.arrays import FloatArray
from picchio.core.provenance import provenance
from picchio.diagnosis.motion.data.system import System
from picchio.diagnosis.motion.fit.least_squares import Fit
from picchio.diagnosis.motion.residual import group_words, motion_residual, rms
from picchio.model.motion import TORQUE
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.visuals.plots.diagnosis import plot_overlay
from picchio.visuals.plots.residual import plot_restoring
from picchio.visuals.plots.style import blank_figure, plain
from picchio.visuals.report.diagnosis_figures import Picture
from picchio.visuals.report.page import number, percent, render, themed_svg


def motion_report(
    robot: FlexibleRobot,
    campaign: Campaign,
    *,
    command: str | None = None,
    warnings: Sequence[str] = (),
) -> str:
    """How the nominal simulation differs from a campaign's motion records, as a page.

    Torques are the inverse dynamics of the measured motion, with the friction that the URDF
    states and each joint's torque scaled within the tolerance; a gear is taken as rigid.

    Args and errors: as `residual_report`.
    """
    left = motion_residual(robot, campaign)
    system, found, groups = left.system, left.fit, left.groups
    prismatic = {j.name for j in robot.tree.joints.values() if j.type == "prismatic"}
    worst = max(groups, key=lambda g: g.left / max(g.noise, 1e-300))
    headline = (
        f"The simulation leaves {percent(worst.share)} % of the {worst.name}; noise alone would "
        f"leave {percent(worst.noise / max(worst.measured, 1e-300))} %."
    )
    folder = campaign.folder
    files = list(robot.files) + ([] if folder is None else [folder / "campaign.toml"])
    return render(
        "residual_motion.html.j2",
        robot=robot.name,
        headline=headline,
        tone="good" if all(g.left < 1.2 * g.noise for g in groups) else "bad",
        groups=[
            (g.name, _shown(g.measured, g.unit), _shown(g.left, g.unit), percent(g.share),
             _shown(g.noise, g.unit), number(g.left / g.noise, 3) if g.noise else "\N{EN DASH}")
            for g in groups
        ],
        sections=[
            _section(system, found, g.group, i, g.group[1] in prismatic)
            for i, g in enumerate(groups)
        ],
        cutoff=number(system.cutoff, 3),
        warnings=list(dict.fromkeys(warnings)),
        records=[log.file for log in system.logs],
        folder="in memory" if folder is None else folder.name,
        command=command
        or f"picchio check {folder or 'CAMPAIGN'} --robot {robot.name} --report OUT.html",
        provenance=provenance(files),
    )  # fmt: skip


def _short(group: tuple[str, str]) -> str:
    kind, joint = group
    return f"torque, {joint}" if kind == TORQUE else f"link - motor, {joint}"


def _shown(value: float, unit: str) -> str:
    scale, name = (1e3, f"m{unit}") if unit in ("rad", "m") else (1.0, unit.replace("*", " "))
    return f"{number(scale * value, 3)} {name}"


def _section(
    system: System, found: Fit, group: tuple[str, str], index: int, prismatic: bool
) -> tuple[str, Picture, list[Picture]]:
    """A heading, the overlay over time, and what is left over the motion."""
    kind, joint = group
    part = max(system.of(group), key=lambda s: rms(found.residual[s.rows]))
    log = system.logs[part.record]
    left = found.residual[part.rows]
    name = f"{'torque' if kind == TORQUE else 'position'}.{joint}"
    unit = {TORQUE: "N" if prismatic else "N*m"}.get(kind, "m" if prismatic else "rad")
    channel = replace(parse_channel(name, unit)[0], name=_short(group))
    time = part.samples / log.rate
    ax = plot_overlay(time, part.measured, {"simulated": part.measured - left}, channel,
                      blank_figure(9.0, 2.7))  # fmt: skip
    over = Picture(
        themed_svg(ax, f"{group_words(group)} as measured and as simulated", f"m{index}"),
        f"In {log.file}, the record that shows most; {percent(rms(left) / rms(part.measured))} % "
        "is left.",
    )
    return group_words(group).capitalize(), over, _clouds(system, found, group, index, prismatic)


def _clouds(
    system: System, found: Fit, group: tuple[str, str], index: int, prismatic: bool
) -> list[Picture]:
    """What is left of all records over position, velocity or torque."""
    kind, joint = group
    parts = system.of(group)
    left = np.concatenate([found.residual[s.rows] for s in parts])

    def seen(name: str) -> FloatArray:
        """A series of the nominal motion at the samples that count."""
        rows = [getattr(system.predictors[s.record].nominal, name)[joint][s.samples] for s in parts]
        return np.concatenate(rows)

    shown: list[tuple[str, FloatArray, str | None]]
    if kind == TORQUE:
        scale, y_label = 1.0, ""
        shown = [("position", seen("angle"), None), ("velocity", seen("velocity"), None)]
    else:
        scale, y_label = 1e3, f"left of the angle [{'mm' if prismatic else 'mrad'}]"
        carried = f"torque that {plain(joint)} carries [{'N' if prismatic else 'N m'}]"
        shown = [("velocity", seen("velocity"), None), ("torque", 1e-3 * seen("body"), carried)]
    made = []
    for over, x, x_label in shown:
        ax = plot_restoring(x, scale * left, joint, blank_figure(5.2, 3.0), over=over,
                            prismatic=prismatic)  # fmt: skip
        if x_label:
            ax.set_xlabel(x_label)
        if y_label:
            ax.set_ylabel(y_label)
        hint = ": a soft gear is a line, play a step" if over == "torque" else ""
        alt = f"What is left of the {group_words(group)} over the {over}"
        made.append(Picture(themed_svg(ax, alt, f"m{index}{over}"),
                            f"Over the {over}, all records{hint}."))  # fmt: skip
    return made
