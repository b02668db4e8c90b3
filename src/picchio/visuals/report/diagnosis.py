"""From a diagnosis of percussion records to one self-contained HTML file."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from markupsafe import Markup

from picchio.core.provenance import provenance
from picchio.diagnosis.percussion.diagnosis import PercussionDiagnosis
from picchio.diagnosis.percussion.follow_up.plan import when
from picchio.diagnosis.result import Cause, Diagnosis
from picchio.model.effects.registry import catalogue
from picchio.studies.assessment.result import format_count
from picchio.visuals.plots.diagnosis import place_in_words
from picchio.visuals.plots.style import direction_label
from picchio.visuals.report.diagnosis_figures import DiagnosisFigures
from picchio.visuals.report.headline import headline
from picchio.visuals.report.page import number, percent, render, spread, words

# The life that a diagnosis tells, as rows of a report's tables.

_LIFE = {
    "rivets_to_failure": "rivets to failure",
    "utilisation": "utilisation, %",
    "damage_per_rivet": "damage a rivet",
    "limiting_joint": "joint that governs",
    "rivets_interval": "rivets to failure, interval",
    "utilisation_interval": "utilisation, %, interval",
}


def life_rows(life: Mapping[str, Any] | None) -> list[tuple[str, str, str]]:
    """Quantity, before, after."""
    if not life:
        return []
    before, after = life.get("baseline") or {}, life.get("extended") or {}
    rows = []
    for key in dict.fromkeys([*before, *after]):
        if isinstance(before.get(key, after.get(key)), Mapping):
            continue
        if key == "rivets_interval" and not _open(before, key) and not _open(after, key):
            continue
        was, now = (_life_cell(key, side.get(key), key in side) for side in (before, after))
        rows.append((_LIFE.get(key, words(str(key))), was, now))
    return rows


def _open(side: Mapping[str, Any], key: str) -> bool:
    """Whether an interval says more than the value."""
    low, high = side.get(key) or (0.0, 0.0)
    return bool(low != high)


def life_by_set(
    life: Mapping[str, Any] | None, diagnosis: Diagnosis
) -> list[tuple[str, str, str, str]]:
    """Every set of causes that the data cannot tell apart: causes, rivets, utilisation, joint."""
    others = (life or {}).get("alternatives") or ()
    if not life or not others:
        return []
    claimed = tuple((cause.effect, cause.target) for cause in diagnosis.causes)
    sets = [
        (claimed, life.get("extended") or {}),
        *zip(diagnosis.alternatives, others, strict=False),
    ]
    return [
        (
            set_words(pairs),
            _life_cell("rivets_to_failure", side.get("why", side.get("rivets_to_failure")), True),
            _life_cell("utilisation", side.get("utilisation"), "why" not in side),
            str(side.get("limiting_joint") or "\N{EN DASH}"),
        )
        for pairs, side in sets
    ]


def life_by_joint(life: Mapping[str, Any] | None) -> list[tuple[str, list[tuple[str, str]]]]:
    """Joint; peak deflection, utilisation, rivets, each before and after, with its interval."""
    if not life:
        return []
    before, after = (
        (life.get(side) or {}).get("joints") or {} for side in ("baseline", "extended")
    )
    rows = []
    for joint in before:
        cells: list[tuple[str, str]] = []
        for key in ("peak_deflection", "utilisation", "rivets_to_failure"):
            for side in (before[joint], after.get(joint, {})):
                value = side.get(key)
                if key == "peak_deflection":
                    cells.append((number(None if value is None else 1e3 * value), ""))
                    continue
                span = "rivets_interval" if "rivets" in key else f"{key}_interval"
                told = _life_cell(span, side[span], True) if _open(side, span) else ""
                cells.append((_life_cell(key, value, key in side), told))
        rows.append((joint, cells))
    return rows


def _life_cell(key: str, value: Any, given: bool) -> str:
    if not given:
        return "\N{EN DASH}"
    if value is None:
        return "no end" if "rivets" in key else "\N{EN DASH}"
    if isinstance(value, (list, tuple)):
        return " to ".join(_life_cell(key, part, True) for part in value)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return str(value)
    if "rivets" in key:
        return format_count(float(value))
    return percent(value) if key.startswith("utilisation") else number(float(value))


def set_words(pairs: Sequence[tuple[str, str]]) -> str:
    """Causes as a phrase."""
    return " and ".join(f"{words(effect)}, {target}" for effect, target in pairs)


def diagnosis_page(
    found: Diagnosis,
    *,
    command: str | None = None,
    warnings: Sequence[str] = (),
    folder: Path | None = None,
) -> str:
    """The page of `picchio.diagnose`'s answer, whichever records it is of.

    Args:
        found: the answer.
        command: the command line that gave this, to reproduce it.
        warnings: what was warned of on the way.
        folder: where the extended model will stand; paths in it are relative to that.

    Raises:
        InputError: a diagnosis without what led to it.
    """
    from picchio.visuals.report.motion_diagnosis import motion_diagnosis_report
    from picchio.visuals.scene.diagnosed import diagnosis_scene

    text = found.model_text(folder)
    details = found.details
    moves = ""
    if "motion" in details:
        moves = motion_diagnosis_report(
            details["motion"],
            life=details["motion_life"],
            carried=details["during_blows"],
            model_toml=text if found.causes and "percussion" not in details else "",
            command=command,
            folder=found.details["folder"],
            warnings=warnings if "percussion" not in details else (),
        )
    if "percussion" not in details:
        return moves
    own = details["percussion"]
    # Candidates are shown by each kind's own search.
    hits = replace(own, diagnosis=replace(found, scores=own.diagnosis.scores))
    return diagnosis_report(
        hits,
        model_toml=text,
        command=command,
        life=found.life,
        warnings=warnings,
        scene=diagnosis_scene(hits).html(),
        moves=_section_of(moves),
    )


def _section_of(page: str) -> str:
    """A page's main part, to stand in another page: its headings one level lower, ids its own."""
    if not page:
        return ""
    main = page.partition("<main>")[2].rpartition("</main>")[0]
    main = re.sub(r"<(/?)h3\b", r"<\1h4", main)
    main = re.sub(r"<(/?)h2\b", r"<\1h3", main)
    main = re.sub(r'\b(id|aria-labelledby)="', r'\1="motion-', main)
    return re.sub(r'href="#', 'href="#motion-', main)


def diagnosis_report(
    found: PercussionDiagnosis,
    *,
    model_toml: str = "",
    command: str | None = None,
    life: Mapping[str, Any] | None = None,
    warnings: Sequence[str] = (),
    scene: str | None = None,
    moves: str = "",
) -> str:
    """What the simulation gets wrong, why, and what is gained, as a page to read and print.

    The page needs nothing from outside, follows the reader's light or dark theme, and escapes
    every name.

    Args:
        found: with all that led to the answer.
        model_toml: the extended model as a `picchio-model/1` file.
        command: the command line that gave this, to reproduce it.
        life: {"baseline": {...}, "extended": {...}} as in the JSON; the diagnosis's own if None.
        warnings: what was warned of on the way, a sentence each.
        scene: HTML of `picchio.visuals.scene.diagnosis_scene`, to be shown in the report; it adds
            its own size.
        moves: HTML of what the motion records of the same campaign say.

    Returns:
        the HTML.
    """
    diagnosis, problem = found.diagnosis, found.problem
    figures = DiagnosisFigures(found)
    campaign = problem.campaign
    name = problem.robot.name
    return render(
        "diagnosis.html.j2",
        robot=name,
        d=diagnosis,
        headline=headline(diagnosis),
        tone={"nothing-wrong": "good", "unexplained": "bad", "partial": "bad"}.get(
            diagnosis.verdict, ""
        ),
        causes=[_card(found, cause) for cause in diagnosis.causes],
        figures=figures,
        changed=figures.changed,
        claimed=bool(diagnosis.causes),
        nuisances=_nuisances(found),
        poses=_poses(found),
        life=life_rows(life if life is not None else diagnosis.life),
        life_joints=life_by_joint(life if life is not None else diagnosis.life),
        life_others=life_by_set(life if life is not None else diagnosis.life, diagnosis),
        interval_level=((life if life is not None else diagnosis.life) or {}).get("interval_level"),
        ask=_ask(diagnosis),
        plan=(diagnosis.next_measurement or {}).get("plan"),
        sets=[set_words(each) for each in diagnosis.alternatives],
        leads=[f"{words(effect)}, {target}" for effect, target in diagnosis.leads],
        warnings=list(dict.fromkeys(warnings)),
        model_toml=model_toml,
        scene=scene,
        moves=Markup(moves),
        shared=_shared(diagnosis),
        kinds=diagnosis.kinds,
        command=command or f"picchio diagnose {name} --data {campaign.folder or 'CAMPAIGN'}",
        folder="in memory" if campaign.folder is None else campaign.folder.name,
        records=len(problem.records),
        n_poses=problem.n_poses,
        groups=problem.groups,
        provenance=provenance(
            [] if campaign.folder is None else [campaign.folder / "campaign.toml"]
        ),
    )


_AGREEMENT = {
    "both": "both kinds of records agree",
    "percussion": "percussion records show it; the motion records cannot see it",
    "motion": "motion records show it; the percussion records cannot see it",
    "drive": "motion records show it, or more of it: in the drive, which stands still under blows",
    "contradiction": "the two kinds of records contradict each other",
}


def _shared(diagnosis: Diagnosis) -> list[tuple[str, str, str, str]]:
    """Cause; its values by percussion and by motion records; what that means."""

    def values(told: Mapping[str, Any] | None) -> str:
        shown = [
            f"{words(name)} {spread(v['value'], v['std'], v['unit'])}"
            for name, v in (told or {}).items() if v["std"] > 0.0
        ]  # fmt: skip
        return ", ".join(shown) or "\N{EN DASH}"

    return [
        (f"{words(each['effect'])}, {each['target']}", values(each["percussion"]),
         values(each["motion"]), _AGREEMENT[each["status"]])
        for each in diagnosis.shared
    ]  # fmt: skip


@dataclass(frozen=True)
class _Card:
    """A cause for people."""

    title: str
    place: str
    meaning: str
    confidence: str
    rows: list[tuple[str, str, str]]
    source: str


def _card(found: PercussionDiagnosis, cause: Cause) -> _Card:
    kind = catalogue().get(cause.effect)
    meanings = {p.name: p.meaning for p in kind.parameters} if kind is not None else {}
    rows = [
        (words(name), spread(v.value, v.std, v.unit), meanings.get(name, ""))
        for name, v in cause.parameters.items()
    ]
    meaning = kind.meaning if kind is not None else ""
    return _Card(
        f"{words(cause.effect)}, {cause.target}",
        place_in_words(found.problem.robot, cause.effect, cause.target),
        f"{meaning[:1].upper()}{meaning[1:]}.",
        "over 99.9" if cause.confidence > 0.999 else percent(cause.confidence),
        rows,
        kind.source if kind is not None else "",
    )


def _nuisances(found: PercussionDiagnosis) -> list[tuple[str, str, str, str]]:
    """Name, value, relative to the nominal one, tolerance."""
    fit = found.extended if found.diagnosis.causes else found.baseline
    hypothesis = fit.hypothesis
    rows = []
    for effect in hypothesis.effects[: hypothesis.n_nuisances]:
        key = effect.tolerance
        name = f"{key}.{effect.target}" if key == "stiffness" else key
        value = found.diagnosis.nuisances.get(name)
        if value is None or effect.label in hypothesis.freed:
            continue
        change = 100.0 * (next(iter(effect.values.values())) - 1.0)
        tolerance = 200.0 * getattr(hypothesis.tolerance, key)
        rows.append(
            (
                name.replace("_", " ", 1)
                if key != "stiffness"
                else f"stiffness of {effect.target}",
                spread(value.value, value.std, value.unit),
                f"{change:+.2f} %".replace("-", "\N{MINUS SIGN}"),
                f"± {tolerance:g} %",
            )
        )
    return rows


def _poses(found: PercussionDiagnosis) -> list[tuple[str, str, str, str]]:
    """Group, pose, power before and after."""
    after = {(level.group, level.part): level for level in found.after.poses}
    rows = []
    for level in found.before.poses:
        then = after.get((level.group, level.part))
        rows.append(
            (level.group, level.part, number(level.power, 3),
             number(then.power if then is not None else None, 3))
        )  # fmt: skip
    return rows


_TOLD = {"one way": "may tell it from", "no": "does not tell it from"}


def _ask(diagnosis: Diagnosis) -> list[tuple[str, str]]:
    """The next measurement, a line each."""
    ask = diagnosis.next_measurement
    if not ask:
        return []
    rows = []
    if ask.get("pose"):
        pose = ", ".join(f"{name} {number(float(q))}" for name, q in ask["pose"].items())
        rows.append(("pose [rad, m]", pose))
    if ask.get("direction") is not None:
        rows.append(("force along", direction_label(ask["direction"])))
    if ask.get("force") is not None:
        rows.append(("force", f"{number(float(ask['force']))} N"))
    if ask.get("temperature") is not None:
        rows.append(("temperature", f"{number(float(ask['temperature']))} deg C"))
    if ask.get("days") is not None:
        rows.append(("when", when(float(ask["days"]))))
    for rival in ask.get("rivals", ()):
        pairs = [(str(effect), str(target)) for effect, target in rival["causes"]]
        least, most = (float(rival.get(k, 0.0)) for k in ("chi_square", "chi_square_at_best"))
        fall = f"chi-square {least:.3g}"
        if most > 2.0 * least:
            fall += f" or {most:.3g}, by what it is"
        told = _TOLD.get(rival.get("told", ""), "tells it from")
        rows.append((told, f"{set_words(pairs)} ({fall})"))
    return rows
