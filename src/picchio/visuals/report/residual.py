"""What a simulation leaves of measured records: one page that names no cause."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from markupsafe import Markup

from picchio.core.errors import InputError
from picchio.core.provenance import provenance
from picchio.diagnosis.motion.residual import MotionResidual, motion_residual
from picchio.diagnosis.percussion.criteria.whiteness import Evidence
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.residual import PercussionResidual, percussion_residual
from picchio.measurement.quality.report import QualityReport
from picchio.prediction.residual import ChannelResidual, growth_with_level, together
from picchio.visuals.plots.style import direction_label
from picchio.visuals.report.motion_figures import MotionResidualFigures
from picchio.visuals.report.page import number, percent, render, signed, words
from picchio.visuals.report.percussion_figures import PercussionResidualFigures

_DASH = "\N{EN DASH}"
# Standard error of the power above which it tells nothing.
_UNSURE = 0.3
# Findings of a check that the page tells.
_MOST_FINDINGS = 12


def check_page(
    found: QualityReport,
    *,
    command: str | None = None,
    warnings: Sequence[str] = (),
    gravity_stiffness: bool | None = None,
) -> str:
    """How the nominal simulation differs from a campaign's records, percussion and motion.

    What the tolerances allow is fitted first, so that what is left is more than that: stiffness,
    damping and force of percussion records; of motion records, which take a gear as rigid, each
    joint's torque and the friction that the URDF states. The page needs nothing from outside and
    escapes every name.

    Args:
        found: of `picchio.check` with a robot; its errors and warnings are told on the page.
        command: the command line that gave this.
        warnings: what was warned of on the way.
        gravity_stiffness: whether gravity's change with the deflection counts.

    Returns:
        the HTML.

    Raises:
        InputError: the check had no robot; no record that can be predicted for this one.
    """
    robot, campaign = found.robot, found.campaign
    if robot is None:
        raise InputError("needs a robot", key="report", hint="name one with --robot")
    serious = [f for f in found.findings if f.severity in ("error", "warning")]
    told = [*warnings, *(f"{f}." for f in serious[:_MOST_FINDINGS])]
    kinds = {record.kind for record in campaign.records}
    moved: MotionResidual | None = None
    if "motion" in kinds:
        try:
            moved = motion_residual(robot, campaign)
        except InputError as error:
            if "percussion" not in kinds:
                raise
            told.append(f"The motion records are left out: {error}.")
    folder = campaign.folder
    page = {
        "layout": "page.html.j2",
        "robot": robot.name,
        "warnings": list(dict.fromkeys(told)),
        "folder": "in memory" if folder is None else folder.name,
        "command": command
        or f"picchio check {folder or 'CAMPAIGN'} --robot {robot.name} --report OUT.html",
        "provenance": provenance(
            [*robot.files, *([] if folder is None else [folder / "campaign.toml"])]
        ),
    }
    part = {"layout": "part.html.j2", "level": 3, "at": "motion-"} if "percussion" in kinds else {}
    moves = ""
    if moved is not None:
        shown = page | _motion(MotionResidualFigures(moved)) | part
        moves = render("residual_motion.html.j2", **shown)
    if not part:
        return moves
    added = robot.adds_gravity(gravity_stiffness, usual=True)
    left = percussion_residual(robot, campaign, gravity_stiffness=added)
    return render("residual.html.j2", **page, **_percussion(left), moves=Markup(moves))


def _percussion(left: PercussionResidual) -> dict[str, Any]:
    """What the page of percussion records shows."""
    figures = PercussionResidualFigures(left)
    parts, whole = left.parts, together(left.parts)
    headline = (
        f"The simulation leaves {percent(whole.nrmse)} % of the signal; noise alone would leave "
        f"{percent(whole.floor)} %. "
    )
    if left.evidence.is_noise:
        headline += "Nothing stands out of the noise."
    else:
        worst = max(parts, key=lambda p: p.times)
        headline += (
            f"It shows most in {worst.channel} ({number(worst.times, 3)} times its noise in "
            f"{worst.record}) and near {number(left.spectra.worst[1], 3)} Hz."
        )
    return {
        "headline": headline,
        "tone": "good" if left.evidence.is_noise else "bad",
        "whole": whole,
        "figures": figures,
        "groups": [(g, together([p for p in parts if p.group == g])) for g in figures.groups],
        "scaling": _scaling(parts, left.evidence),
        "rows": _rows(parts),
        "fitted": _fitted(left.fit.hypothesis),
        "records": len(left.problem.records),
        "n_poses": left.problem.n_poses,
    }


def _motion(figures: MotionResidualFigures) -> dict[str, Any]:
    """What the page of motion records shows."""
    groups = figures.left.groups
    worst = max(groups, key=lambda g: g.left / max(g.noise, 1e-300))

    def shown(value: float, unit: str) -> str:
        scale, name = (1e3, f"m{unit}") if unit in ("rad", "m") else (1.0, unit.replace("*", " "))
        return f"{number(scale * value, 3)} {name}"

    return {
        "headline": (
            f"The simulation leaves {percent(worst.share)} % of the {worst.name}; noise alone "
            f"would leave {percent(worst.noise / max(worst.measured, 1e-300))} %."
        ),
        "tone": "good" if all(g.left < 1.2 * g.noise for g in groups) else "bad",
        "groups": [
            (g.name, shown(g.measured, g.unit), shown(g.left, g.unit), percent(g.share),
             shown(g.noise, g.unit), number(g.left / g.noise, 3) if g.noise else _DASH)
            for g in groups
        ],
        "sections": [figures.section(g) for g in groups],
        "cutoff": number(figures.left.system.cutoff, 3),
        "records": len(figures.left.system.logs),
    }  # fmt: skip


def _scaling(parts: Sequence[ChannelResidual], evidence: Evidence) -> str:
    """Whether the residual scales with the blows, in a sentence."""
    if evidence.is_noise:
        return ""
    found = growth_with_level(parts)
    if found is None:
        return (
            "Whether the residual scales with the blows cannot be said: their heights hardly "
            "differ, or too few records stand out of the noise."
        )
    power, error = found
    text = f"Over the records the residual grows as force to the power {power:.2f} ± {error:.2f}"
    if error > _UNSURE:
        return text + ", too unsure to say whether it scales."
    if abs(power - 1.0) <= max(2.0 * error, 0.1):
        return text + ": it scales, as the error of a linear model does."
    return text + (": more slowly than the force." if power < 1.0 else ": faster than the force.")


def _rows(parts: Sequence[ChannelResidual]) -> list[tuple[str, ...]]:
    return [
        (
            p.record,
            p.channel,
            f"{p.pose + 1}",
            direction_label(p.direction),
            number(p.level),
            number(p.temperature, 3),
            _DASH if p.taken is None else p.taken.strftime("%Y-%m-%d %H:%M"),
            percent(p.nrmse),
            number(p.times, 3),
            percent(p.above_noise),
        )
        for p in parts
    ]


def _fitted(hypothesis: Hypothesis) -> list[tuple[str, str]]:
    rows = []
    for effect in hypothesis.effects[: hypothesis.n_nuisances]:
        change = 100.0 * (next(iter(effect.values.values())) - 1.0)
        target = "" if effect.target in ("robot", "tool") else f" of {effect.target}"
        rows.append((f"{words(effect.name)}{target}", f"{signed(change, 2)} %"))
    return rows
