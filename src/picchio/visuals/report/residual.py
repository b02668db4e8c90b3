"""What a simulation leaves of measured records: one page that names no cause."""

from __future__ import annotations

from collections.abc import Sequence

from picchio.campaign.campaign import Campaign
from picchio.core.errors import InputError
from picchio.core.provenance import provenance
from picchio.diagnosis.percussion.criteria.whiteness import Evidence
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.residual import Spectra, percussion_residual
from picchio.measurement.quality.report import QualityReport
from picchio.prediction.residual import ChannelResidual, Together, growth_with_level, together
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.visuals.plots.style import direction_label
from picchio.visuals.report.page import number, percent, render
from picchio.visuals.report.residual_figures import ResidualFigures

# Standard error of the power above which it tells nothing.
_UNSURE = 0.3


def check_page(
    found: QualityReport,
    *,
    command: str | None = None,
    warnings: Sequence[str] = (),
    gravity_stiffness: bool = True,
) -> str:
    """The page of `residual_report` for the campaign and the robot of a check.

    Raises:
        InputError: as `residual_report`; the check had no robot.
    """
    if found.robot is None:
        raise InputError("needs a robot", key="report", hint="name one with --robot")
    return residual_report(found.robot, found.campaign, quality=found, command=command,
                           warnings=warnings, gravity_stiffness=gravity_stiffness)  # fmt: skip


def residual_report(
    robot: FlexibleRobot,
    campaign: Campaign,
    *,
    quality: QualityReport | None = None,
    command: str | None = None,
    warnings: Sequence[str] = (),
    gravity_stiffness: bool = True,
) -> str:
    """How the nominal simulation differs from a campaign's percussion records.

    A campaign of motion records alone gets the page of `motion_report`.

    Stiffness, damping and force are fitted within the campaign's tolerance first, so that what
    is left is more than that. The page needs nothing from outside and escapes every name.

    Args:
        robot: as its files have it.
        campaign: the records; beside percussion records those of motion are left out.
        quality: what `picchio.check` saw; its errors and warnings are told on the page.
        command: the command line that gave this.
        warnings: what was warned of on the way.
        gravity_stiffness: whether gravity's change with the deflection counts.

    Returns:
        the HTML.

    Raises:
        InputError: no record that can be predicted for this robot.
    """
    told = list(dict.fromkeys([*warnings, *_findings(quality)]))
    if not any(record.kind == "percussion" for record in campaign.records):
        from picchio.visuals.report.residual_motion import motion_report

        return motion_report(robot, campaign, command=command, warnings=told)
    left = percussion_residual(robot, campaign, gravity_stiffness=gravity_stiffness)
    evidence, parts, problem = left.evidence, left.parts, left.problem
    whole = together(parts)
    figures = ResidualFigures(left)
    others = sum(record.kind == "motion" for record in campaign.records)
    if others:
        told.append(f"{others} motion records are not on this page; picchio diagnose uses both.")
    return render(
        "residual.html.j2",
        robot=robot.name,
        headline=_headline(whole, evidence, parts, left.spectra),
        tone="good" if evidence.is_noise else "bad",
        whole=whole,
        figures=figures,
        groups=[(g, together([p for p in parts if p.group == g])) for g in figures.groups],
        scaling=_scaling(parts, evidence),
        rows=_rows(parts),
        fitted=_fitted(left.fit.hypothesis),
        warnings=told,
        records=len(problem.records),
        n_poses=problem.n_poses,
        folder="in memory" if campaign.folder is None else campaign.folder.name,
        command=command
        or f"picchio check {campaign.folder or 'CAMPAIGN'} --robot {robot.name} --report OUT.html",
        provenance=provenance(
            [
                *robot.files,
                *([] if campaign.folder is None else [campaign.folder / "campaign.toml"]),
            ]
        ),
    )


def _headline(
    whole: Together, evidence: Evidence, parts: Sequence[ChannelResidual], found: Spectra
) -> str:
    share = f"{percent(whole.nrmse)} % of the signal; noise alone would leave "
    share += f"{percent(whole.floor)} %."
    if evidence.is_noise:
        return f"The simulation leaves {share} Nothing stands out of the noise."
    worst = max(parts, key=lambda p: p.times)
    _, frequency, _ = found.worst
    return (
        f"The simulation leaves {share} It shows most in {worst.channel} "
        f"({number(worst.times, 3)} times its noise in {worst.record}) and near "
        f"{number(frequency, 3)} Hz."
    )


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
    if power < 1.0:
        return text + ": more slowly than the force."
    return text + ": faster than the force."


def _rows(parts: Sequence[ChannelResidual]) -> list[tuple[str, ...]]:
    return [
        (
            p.record,
            p.channel,
            f"{p.pose + 1}",
            direction_label(p.direction),
            number(p.level),
            "\N{EN DASH}" if p.temperature is None else number(p.temperature, 3),
            "\N{EN DASH}" if p.taken is None else p.taken.strftime("%Y-%m-%d %H:%M"),
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
        name = effect.name.replace("_", " ")
        target = "" if effect.target in ("robot", "tool") else f" of {effect.target}"
        rows.append((f"{name}{target}", f"{change:+.2f} %".replace("-", "\N{MINUS SIGN}")))
    return rows


def _findings(quality: QualityReport | None) -> list[str]:
    if quality is None:
        return []
    return [f"{f}." for f in quality.findings if f.severity in ("error", "warning")][:12]
