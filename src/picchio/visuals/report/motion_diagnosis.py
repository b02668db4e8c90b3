"""From a diagnosis of motion records to one self-contained HTML file."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from picchio.core.provenance import provenance
from picchio.diagnosis.motion.conclude.during_blows import BlowEffects, MotionLife
from picchio.diagnosis.motion.data.system import System
from picchio.diagnosis.result import Cause, Diagnosis, differences, in_words
from picchio.model.effects.registry import catalogue
from picchio.visuals.plots.diagnosis import place_in_words
from picchio.visuals.report.headline import by_kind, headline, shown, value_text
from picchio.visuals.report.motion_diagnosis_figures import MotionFigures
from picchio.visuals.report.page import number, percent, render, words

_DERIVED = {"amplitude": "of the wave", "stiffness": "of the joint"}


def motion_diagnosis_report(
    diagnosis: Diagnosis,
    *,
    life: MotionLife,
    carried: BlowEffects,
    model_toml: str = "",
    command: str | None = None,
    folder: str | None = None,
    warnings: Sequence[str] = (),
) -> str:
    """What the simulation of a moving robot gets wrong, why, and what is gained, as a page.

    The page needs nothing from outside, follows the reader's light or dark theme, and escapes
    every name.

    Args:
        diagnosis: of motion records.
        life: what that does to the life.
        carried: which causes the life takes into account.
        model_toml: the extended model as a `picchio-model/1` file.
        command: the command line that gave this, to reproduce it.
        folder: of the campaign; in memory if None.
        warnings: what was warned of on the way, a sentence each.

    Returns:
        the HTML.
    """
    system: System = diagnosis.details["systems"]["train"]
    robot = system.robot
    figures = MotionFigures(diagnosis)
    claimed = bool(diagnosis.causes)
    judged = diagnosis.details["systems"]["held_out"]
    return render(
        "motion_diagnosis.html.j2",
        robot=robot.name,
        d=diagnosis,
        headline=headline(diagnosis),
        tone={"nothing-wrong": "good", "unexplained": "bad", "partial": "bad"}.get(
            diagnosis.verdict, ""
        ),
        kinds=_kinds(diagnosis, system),
        figures=figures,
        changed=figures.changed,
        claimed=claimed,
        channels=_channels(diagnosis),
        held_out=judged is not system,
        nuisances=[(_said(k), value_text(v)) for k, v in diagnosis.nuisances.items()],
        instruments=_instruments(diagnosis),
        stiffness=_stiffness(diagnosis),
        life=_life(life),
        why=life.why,
        blows=_blows(life),
        left=[(f"{words(e.name)}, {e.target}", why) for e, why in _once(carried)],
        sets=[in_words(each) for each in differences(diagnosis)],
        leads=[f"{words(effect)}, {target}" for effect, target in diagnosis.leads],
        warnings=list(dict.fromkeys(warnings)),
        model_toml=model_toml,
        command=command or f"picchio diagnose {robot.name} --data {folder or 'CAMPAIGN'}",
        folder=folder or "in memory",
        records=len({log.file for s in (system, judged) for log in s.logs}),
        cutoff=number(system.cutoff, 3),
        provenance=provenance(list(robot.files)),
    )


def _kinds(diagnosis: Diagnosis, system: System) -> list[dict[str, object]]:
    """Each kind of cause: what it means, where it sits, and a row for each place."""
    made: list[dict[str, object]] = []
    for name, causes in by_kind(diagnosis).items():
        kind = catalogue().get(name)
        meaning = (kind.motion_meaning or kind.meaning) if kind is not None else ""
        columns = list(dict.fromkeys(key for cause in causes for key in shown(cause)))
        meanings = {p.name: p.meaning for p in kind.parameters} if kind is not None else {}
        made.append({
            "title": words(name),
            "meaning": f"{meaning[:1].upper()}{meaning[1:]}.",
            "place": place_in_words(system.robot, name, causes[0].target)
            if len(causes) == 1 else "",
            "columns": [(words(key), meanings.get(key, _DERIVED.get(key, ""))) for key in columns],
            "rows": [
                (cause.target,
                 [value_text(cause.parameters[key]) if key in cause.parameters else "\N{EN DASH}"
                  for key in columns],
                 "over 99.9" if cause.confidence > 0.999 else percent(cause.confidence))
                for cause in sorted(causes, key=_place)
            ],
            "source": kind.source if kind is not None else "",
        })  # fmt: skip
    return made


def _place(cause: Cause) -> tuple[str, float]:
    order = cause.parameters.get("order")
    return cause.target, order.value if order is not None else 0.0


def _channels(diagnosis: Diagnosis) -> list[tuple[str, ...]]:
    """Record, channel, and RMS: measured, before, after, noise."""
    rows = []
    for row in diagnosis.details["held_out"]:
        kind, _, joint = row["channel"].partition(".")
        if kind == "ripple":
            continue
        scale = 1e3 if kind == "windup" else 1.0
        cells = [
            number(scale * row[key], 4 if scale * row[key] >= 1e3 else 3)
            for key in ("measured", "baseline", "extended", "noise")
        ]
        name = f"torque, {joint}" if kind == "torque" else f"link less motor, {joint} (mrad, mm)"
        rows.append((row["record"], name, *cells))
    return rows


def _instruments(diagnosis: Diagnosis) -> list[str]:
    """Numbers that feedback or encoder noise biases."""
    return [
        f"{words(s.effect)}, {s.target}, {words(s.parameter)}: {number(s.least_squares)} by least "
        f"squares, {number(s.instrumental)} with the command as instrument"
        for s in diagnosis.details.get("instruments", ()) if s.significant
    ]  # fmt: skip


def _stiffness(diagnosis: Diagnosis) -> list[str]:
    return [
        f"{joint}: {number(told['ratio'], 3)} times the documented stiffness; with no delay in the "
        f"model it would come out as {number(told['ratio_without_delay'], 3)} times."
        for joint, told in diagnosis.details.get("stiffness", {}).items()
    ]


def _life(life: MotionLife) -> list[tuple[str, str, str, str, str]]:
    """Joint; rivets and utilisation, before and after."""
    from picchio.studies.assessment.result import format_count

    if life.life is None:
        return []
    before, after = (life.life[side]["joints"] for side in ("baseline", "extended"))
    return [
        (name, format_count(old["rivets_to_failure"]),
         format_count(after[name]["rivets_to_failure"]),
         percent(old["utilisation"]), percent(after[name]["utilisation"]))
        for name, old in before.items()
    ]  # fmt: skip


def _blows(life: MotionLife) -> list[tuple[str, str, str, str]]:
    """Joint; peak deflection before and after, and the change in per cent."""
    if not life.blows:
        return []
    after = life.blows["extended"]
    return [
        (name, number(1e3 * was), number(1e3 * after[name]),
         f"{100.0 * (after[name] / was - 1.0):+.1f}".replace("-", "\N{MINUS SIGN}")
         if was > 0.0 and np.isfinite(was) else "\N{EN DASH}")
        for name, was in life.blows["baseline"].items()
    ]  # fmt: skip


def _once(carried: BlowEffects) -> list[tuple]:  # type: ignore[type-arg]
    return list({(e.name, e.target): (e, why) for e, why in carried.left}.values())


def _said(name: str) -> str:
    what, _, where = name.partition(".")
    return f"{words(what)} of {where}" if where else words(what)
