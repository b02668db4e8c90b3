"""From a diagnosis to one self-contained HTML file: of percussion records, motion, or both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from picchio.core import spoken
from picchio.core.provenance import provenance
from picchio.diagnosis.life import matters
from picchio.diagnosis.motion.conclude.during_blows import BlowEffects, MotionLife
from picchio.diagnosis.motion.data.system import System
from picchio.diagnosis.percussion.conclude.causes import nuisance_name
from picchio.diagnosis.percussion.diagnosis import PercussionDiagnosis
from picchio.diagnosis.percussion.follow_up.records import when
from picchio.diagnosis.result import Cause, Diagnosis, Value, differences, in_tolerances, in_words
from picchio.model.effects.registry import catalogue
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.visuals.plots.diagnosis import place_in_words
from picchio.visuals.plots.style import direction_label
from picchio.visuals.report.motion_figures import MotionFigures
from picchio.visuals.report.page import capitalised, number, percent, render, signed, spread, words
from picchio.visuals.report.percussion_figures import PercussionFigures
from picchio.visuals.report.trace import traces_html
from picchio.visuals.scene.build import diagnosis_scene

_DASH = "\N{EN DASH}"
_KINDS = {"percussion.html.j2": "measured under blows", "motion.html.j2": "measured in motion"}
_TONE = {"nothing-wrong": "good", "unexplained": "bad", "partial": "bad"}


def diagnosis_page(
    found: Diagnosis,
    *,
    command: str | None = None,
    warnings: Sequence[str] = (),
    folder: Path | None = None,
    scene: bool = True,
) -> str:
    """What the simulation gets wrong, why, and what is gained, as a page to read and print.

    The page needs nothing from outside, follows the reader's light or dark theme, and escapes
    every name.

    Args:
        found: of `picchio.diagnose`.
        command: the command line that gave this, to reproduce it.
        warnings: what was warned of on the way, a sentence each.
        folder: where the extended model will stand; paths in it are relative to that.
        scene: whether the causes of percussion records are shown in 3-D, which adds about 1 MB.

    Returns:
        the HTML.

    Raises:
        InputError: a diagnosis without what led to it.
    """
    text = found.model_text(folder)
    details = found.details
    told = list(dict.fromkeys(warnings))

    def drawn(template: str, of: Diagnosis, robot: FlexibleRobot, content: dict[str, Any]) -> str:
        gain = of.gain
        return render(
            template,
            robot=robot.name,
            d=of,
            headline=headline(of),
            changed=content["figures"].changed,
            tone=_TONE.get(of.verdict, ""),
            claimed=bool(of.causes),
            held_out=gain is not None and gain.held_out_records not in ((), gain.train_records),
            leads=[f"{words(effect)}, {target}" for effect, target in of.leads],
            command=command
            or f"picchio diagnose {robot.name} --data {details['folder'] or 'CAMPAIGN'}",
            folder=details["folder"] or "in memory",
            traces=traces_html(content["figures"].traces(), f"What was {_KINDS[template]}"),
            provenance=found.extra.get("provenance") or provenance([]),
            **content,
        )

    hits: PercussionDiagnosis | None = details.get("percussion")
    moves: Diagnosis | None = details.get("motion")
    page = {"layout": "page.html.j2", "warnings": told, "model_toml": text}
    of_moves = ""
    if moves is not None:
        system = moves.details["systems"]["train"]
        shown = _motion(moves, system, details["motion_life"], details["during_blows"])
        if hits is not None:
            shown |= {"layout": "part.html.j2", "level": 3, "at": "motion-", "model_toml": ""}
        else:
            shown |= page | ({} if found.causes else {"model_toml": ""})
        of_moves = drawn("motion.html.j2", moves, system.robot, shown)
    if hits is None:
        return of_moves
    # Candidates are shown by each kind's own search.
    hits = replace(hits, diagnosis=replace(found, scores=hits.diagnosis.scores))
    shown = page | _percussion(hits, moves is not None)
    shown |= {"moves": Markup(of_moves), "scene": diagnosis_scene(hits).html() if scene else None}
    return drawn("percussion.html.j2", hits.diagnosis, hits.problem.robot, shown)


def _percussion(found: PercussionDiagnosis, also_motion: bool) -> dict[str, Any]:
    """What only the page of percussion records shows."""
    diagnosis, problem = found.diagnosis, found.problem
    figures = PercussionFigures(found)
    poses = f"{problem.n_poses} pose{'s' if problem.n_poses != 1 else ''}"
    taken = len(problem.records)
    records = f"{taken} percussion record{'s' if taken != 1 else ''}"
    others = " and of motion records" if also_motion else ""
    return {
        "figures": figures,
        "taken": f"{records} at {poses}{others}",
        "cards": [_card(problem.robot, cause) for cause in diagnosis.causes],
        "before": found.before,
        "after": found.after,
        "nuisances": _nuisances(found),
        "poses": _poses(found, figures.changed),
        "tells_life": bool(diagnosis.life),
        "life": _life_rows(diagnosis.life),
        "life_joints": _life_by_joint(diagnosis.life),
        "life_sets": _life_by_set(diagnosis),
        "life_causes": _life_by_cause(diagnosis.life),
        "ask": _ask(diagnosis),
        "sets": [_set_words(each) for each in diagnosis.alternatives],
        "shared": _shared(diagnosis),
        "channels": problem.groups,
    }


def _motion(
    diagnosis: Diagnosis, system: System, life: MotionLife, carried: BlowEffects
) -> dict[str, Any]:
    """What only the page of motion records shows."""
    figures = MotionFigures(diagnosis)
    details = diagnosis.details
    logs = {log.file for each in details["systems"].values() for log in each.logs}
    return {
        "figures": figures,
        "taken": f"{len(logs)} motion record{'s' if len(logs) != 1 else ''}",
        "cards": _cards(diagnosis, system.robot),
        "stiffness": [
            f"{joint}: {number(told['ratio'], 3)} times the documented stiffness; with no delay in "
            f"the model it would come out as {number(told['ratio_without_delay'], 3)} times."
            for joint, told in details.get("stiffness", {}).items()
        ],
        "rows": _channels(diagnosis, figures.changed),
        "cutoff": number(system.cutoff, 3),
        "nuisances": [(_said(name), _value_text(v)) for name, v in diagnosis.nuisances.items()],
        "instruments": [
            f"{words(s.effect)}, {s.target}, {words(s.parameter)}: {number(s.least_squares)} by "
            f"least squares, {number(s.instrumental)} with the command as instrument"
            for s in details.get("instruments", ()) if s.significant
        ],
        "tells_life": True,
        "why": capitalised(life.why),
        "life": [(joint, *cells[4:], *cells[2:4]) for joint, *cells in _life_by_joint(life.life)],
        "blows": _blows(life),
        "left_out": list({
            (e.name, e.target): (f"{words(e.name)}, {e.target}", why) for e, why in carried.left
        }.values()),
        "sets": [in_words(each) for each in differences(diagnosis)],
    }  # fmt: skip


# The verdict in a sentence or two.

_DETAILED = 3  # causes of one kind whose numbers a headline gives


def headline(diagnosis: Diagnosis) -> str:
    """The verdict in a sentence or two; many causes of a kind are counted."""
    named = "; and ".join(_phrase(kind, causes) for kind, causes in _by_kind(diagnosis).items())
    gain = diagnosis.gain
    effect = ""
    if gain is not None and diagnosis.causes:
        fitted = gain.held_out_records in ((), gain.train_records)
        seen = "fitted" if fitted else "held out"
        effect = (
            f" On records {seen} the error falls from {percent(gain.baseline_nrmse)} % of the "
            f"signal to {percent(gain.extended_nrmse)} %; noise alone leaves "
            f"{percent(gain.noise_floor_nrmse)} %."
        )
    match diagnosis.verdict:
        case "nothing-wrong":
            return (
                "Nothing wrong: within its stated tolerance the simulation leaves nothing but "
                "noise."
            )
        case "named":
            return f"What is wrong: {named}.{effect}"
        case "ambiguous":
            return (
                f"What is wrong: {named}; or something that these data cannot tell from it.{effect}"
            )
        case "partial":
            share = gain.explained if gain is not None else None
            most = "most" if share is None else f"{percent(min(share, 1.0))} %"
            return (
                f"Part of what is wrong: {named}; or something that acts much like it. It explains "
                f"{most} of the error; more than noise is left, and nothing known explains "
                f"that.{effect}"
            )
    if diagnosis.note:
        return f"The simulation is wrong. {capitalised(diagnosis.note)}."
    lead = f" What helped stands below: {len(diagnosis.leads)} leads, no more."
    return "The simulation is wrong, and no known cause explains most of it: none is claimed." + (
        lead if len(diagnosis.leads) > 1 else ""
    )


def _by_kind(diagnosis: Diagnosis) -> dict[str, list[Cause]]:
    """Effect -> its causes."""
    found: dict[str, list[Cause]] = {}
    for cause in diagnosis.causes:
        found.setdefault(cause.effect, []).append(cause)
    return found


def _phrase(kind: str, causes: Sequence[Cause]) -> str:
    if len(causes) >= _DETAILED:
        places = len({c.target for c in causes})
        what = f"{words(kind)} in {places} joint{'s' if places > 1 else ''}"
        return f"{what}, {len(causes)} harmonics" if catalogue()[kind].periodic else what
    said = []
    for cause in causes:
        parts = ", ".join(
            f"{'every' if name == 'period' else words(name)} {_value_text(v)}"
            for name, v in _shown(cause).items()
        )
        where = "" if cause.target in ("robot", "tool") else f" of {cause.target}"
        said.append(f"{words(kind)}{where}, {parts}" if parts else f"{words(kind)}{where}")
    return "; ".join(said)


def _shown(cause: Cause) -> dict[str, Value]:
    """Without the two parts of a wave, whose amplitude is given, or a slide's turns."""
    replaced = {"amplitude": {"cosine", "sine"}, "period": {"order"}}
    left_out = {old for new in replaced.keys() & cause.parameters.keys() for old in replaced[new]}
    return {name: v for name, v in cause.parameters.items() if name not in left_out}


def _value_text(v: Value) -> str:
    """Value and standard deviation."""
    # Delays are told in milliseconds, the pitch of a screw in millimetres.
    if v.unit in ("s", "m"):
        return spread(1e3 * v.value, 1e3 * v.std, f"m{v.unit}")
    return spread(v.value, v.std, v.unit)


def _set_words(pairs: Sequence[tuple[str, str]]) -> str:
    """Causes as a phrase."""
    return " and ".join(f"{words(effect)}, {target}" for effect, target in pairs)


# The causes, each with its meaning: heads and rows of a table, and what stands above and below.


_DERIVED = {"amplitude": "of the wave", "stiffness": "of the joint", "period": "along its way"}


def _card(robot: FlexibleRobot, cause: Cause) -> dict[str, Any]:
    """One cause, a row a parameter."""
    kind = catalogue()[cause.effect]
    meanings = _DERIVED | {p.name: p.meaning for p in kind.parameters}
    place = place_in_words(robot, cause.effect, cause.target)
    off = "" if cause.tolerances is None else f" It is {in_tolerances(cause)}."
    return {
        "title": f"{words(cause.effect)}, {cause.target}",
        "lines": [f"{capitalised(kind.meaning)}.",
                  f"It sits {place}. Confidence {_confidence(cause)}\N{NO-BREAK SPACE}%.{off}"],
        "heads": [],
        "rows": [(words(name), _value_text(v), meanings.get(name, ""))
                 for name, v in _shown(cause).items()],
        "source": kind.source,
    }  # fmt: skip


def _cards(diagnosis: Diagnosis, robot: FlexibleRobot) -> list[dict[str, Any]]:
    """All causes of a kind together, a row a place."""
    made = []
    for name, causes in _by_kind(diagnosis).items():
        kind = catalogue()[name]
        meaning = f"{capitalised(kind.motion_meaning or kind.meaning)}."
        if len(causes) == 1:
            meaning += f" It sits {place_in_words(robot, name, causes[0].target)}."
        columns = list(dict.fromkeys(key for cause in causes for key in _shown(cause)))
        meanings = _DERIVED | {p.name: p.meaning for p in kind.parameters}
        made.append({
            "title": words(name),
            "lines": [meaning],
            "heads": ["", *(f"{words(key)}|{meanings.get(key, '')}" for key in columns),
                      "confidence|%"],
            "rows": [
                (cause.target,
                 *(_value_text(cause.parameters[key]) if key in cause.parameters else _DASH
                   for key in columns),
                 _confidence(cause))
                for cause in sorted(causes, key=_place)
            ],
            "source": kind.source,
        })  # fmt: skip
    return made


def _confidence(cause: Cause) -> str:
    return "over 99.9" if cause.confidence > 0.999 else percent(cause.confidence)


def _place(cause: Cause) -> tuple[str, float]:
    order = cause.parameters.get("order")
    return cause.target, order.value if order is not None else 0.0


def _said(name: str) -> str:
    what, _, where = name.partition(".")
    return f"{words(what)} of {where}" if where else words(what)


# The life that a diagnosis tells, as rows of a report's tables.

_LIFE = {
    "rivets_to_failure": "rivets to failure",
    "utilisation": "utilisation, %",
    "damage_per_rivet": "damage a rivet",
    "limiting_joint": "joint that governs",
    "rivets_interval": "rivets to failure, interval",
    "utilisation_interval": "utilisation, %, interval",
}


def _sides(life: Mapping[str, Any] | None) -> tuple[Mapping[str, Any], Mapping[str, Any]]:
    """Before and after."""
    return (life or {}).get("baseline") or {}, (life or {}).get("extended") or {}


def _life_rows(life: Mapping[str, Any] | None) -> list[tuple[str, str, str]]:
    """Quantity, before, after."""
    before, after = _sides(life)
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


def _life_by_set(diagnosis: Diagnosis) -> list[tuple[str, str, str, str]]:
    """Every set of causes that the data cannot tell apart: causes, rivets, utilisation, joint."""
    life = diagnosis.life or {}
    others = life.get("alternatives")
    if not others:
        return []
    claimed = tuple((cause.effect, cause.target) for cause in diagnosis.causes)
    sets = [
        (claimed, life.get("extended") or {}),
        *zip(diagnosis.alternatives, others, strict=False),
    ]
    return [
        (
            _set_words(pairs),
            _life_cell("rivets_to_failure", side.get("why", side.get("rivets_to_failure"))),
            _life_cell("utilisation", side.get("utilisation"), "why" not in side),
            str(side.get("limiting_joint") or _DASH),
        )
        for pairs, side in sets
    ]


def _life_by_cause(life: Mapping[str, Any] | None) -> list[tuple[str, str, str]]:
    """Cause; rivets and utilisation once it alone is mended, the one that matters most first."""
    rows = (life or {}).get("causes") or ()
    if life is None or not any(matters(row, life) for row in rows):
        return []
    return [
        (
            f"{words(row['effect'])}, {row['target']}",
            _life_cell("rivets_to_failure", row.get("why", row.get("rivets_to_failure"))),
            _life_cell("utilisation", row.get("utilisation"), "why" not in row),
        )
        for row in rows
    ]


def _life_by_joint(life: Mapping[str, Any] | None) -> list[tuple[str, ...]]:
    """Joint; peak deflection, utilisation, rivets, each before and after, with its interval."""
    before, after = (side.get("joints") or {} for side in _sides(life))
    rows = []
    for joint in before:
        cells: list[str] = []
        for key in ("peak_deflection", "utilisation", "rivets_to_failure"):
            for side in (before[joint], after.get(joint, {})):
                value = side.get(key)
                if key == "peak_deflection":
                    cells.append(number(None if value is None else 1e3 * value))
                    continue
                cell = _life_cell(key, value, key in side)
                span = "rivets_interval" if "rivets" in key else f"{key}_interval"
                if _open(side, span):
                    cell = Markup('{}<span class="span">{}</span>').format(
                        cell, _life_cell(span, side[span])
                    )
                cells.append(cell)
        rows.append((joint, *cells))
    return rows


def _life_cell(key: str, value: Any, given: bool = True) -> str:
    if not given:
        return _DASH
    if value is None:
        return "unlimited" if "rivets" in key else _DASH
    if isinstance(value, (list, tuple)):
        return " to ".join(_life_cell(key, part) for part in value)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return str(value)
    if "rivets" in key:
        return spoken.count(float(value))
    return percent(value) if key.startswith("utilisation") else number(float(value))


def _blows(life: MotionLife) -> list[tuple[str, str, str, str]]:
    """Joint; peak deflection before and after, and the change in per cent."""
    after = life.blows.get("extended", {})
    return [
        (name, number(1e3 * was), number(1e3 * after[name]),
         signed(100.0 * (after[name] / was - 1.0), 1) if was > 0.0 and np.isfinite(was) else _DASH)
        for name, was in life.blows.get("baseline", {}).items()
    ]  # fmt: skip


# What the two kinds of records say of a cause.

_AGREEMENT = {
    "both": "both kinds of records agree",
    "percussion": "percussion records show it; the motion records cannot see it",
    "motion": "motion records show it; the percussion records cannot see it",
    "drive": "motion records show it, or more: in the drive (motors assumed locked under blows)",
    "contradiction": "the two kinds of records contradict each other",
}


def _shared(diagnosis: Diagnosis) -> list[tuple[str, str, str, str]]:
    """Cause; its values by percussion and by motion records; what that means."""

    def values(told: Mapping[str, Any] | None) -> str:
        shown = [
            f"{words(name)} {_value_text(Value(**v))}"
            for name, v in (told or {}).items() if v["std"] > 0.0
        ]  # fmt: skip
        return ", ".join(shown) or _DASH

    return [
        (f"{words(each['effect'])}, {each['target']}", values(each["percussion"]),
         values(each["motion"]), _AGREEMENT[each["status"]])
        for each in diagnosis.shared
    ]  # fmt: skip


# What was fitted, and what is left.


def _nuisances(found: PercussionDiagnosis) -> list[tuple[str, str, str, str]]:
    """Name, value, relative to the nominal one, tolerance."""
    fit = found.extended if found.diagnosis.causes else found.baseline
    hypothesis = fit.hypothesis
    rows = []
    for effect in hypothesis.effects[: hypothesis.n_nuisances]:
        key = effect.tolerance
        name = nuisance_name(effect)
        value = found.diagnosis.nuisances.get(name)
        if value is None or effect.label in hypothesis.freed:
            continue
        change = 100.0 * (next(iter(effect.values.values())) - 1.0)
        tolerance = 200.0 * getattr(hypothesis.tolerance, key)
        said = f"stiffness of {effect.target}" if key == "stiffness" else name.replace("_", " ", 1)
        rows.append((said, _value_text(value), f"{signed(change, 2)} %", f"± {tolerance:g} %"))
    return rows


def _poses(found: PercussionDiagnosis, changed: bool) -> list[tuple[str, ...]]:
    """Group, pose, power before and, if it is another model, after."""
    after = {(level.group, level.part): number(level.power, 3) for level in found.after.poses}
    return [
        (level.group, level.part, number(level.power, 3),
         *([after.get((level.group, level.part), _DASH)] if changed else []))
        for level in found.before.poses
    ]  # fmt: skip


def _channels(diagnosis: Diagnosis, changed: bool) -> list[tuple[str, ...]]:
    """Record, channel, and RMS: measured, before, after if it is another model, noise."""
    names = ("measured", "baseline", "extended", "noise")
    keys = [key for key in names if changed or key != "extended"]
    rows = []
    for row in diagnosis.details["held_out"]:
        kind, _, joint = row["channel"].partition(".")
        if kind == "ripple":
            continue
        scale = 1e3 if kind == "windup" else 1.0
        cells = [number(scale * row[key], 4 if scale * row[key] >= 1e3 else 3) for key in keys]
        name = f"torque, {joint}" if kind == "torque" else f"link less motor, {joint} (mrad, mm)"
        rows.append((row["record"], name, *cells))
    return rows


_TOLD = {"one way": "may tell it from", "no": "does not tell it from"}


def _ask(diagnosis: Diagnosis) -> list[tuple[str, str]]:
    """The next measurement, a line each."""
    ask = diagnosis.next_measurement or {}
    rows = []
    if ask.get("pose"):
        pose = ", ".join(f"{name} {number(float(q))}" for name, q in ask["pose"].items())
        rows.append(("pose [rad, m]", pose))
    if ask.get("direction") is not None:
        rows.append(("force along", direction_label(ask["direction"])))
    for key, unit in (("force", "N"), ("temperature", "deg C")):
        if ask.get(key) is not None:
            rows.append((key, f"{number(float(ask[key]))} {unit}"))
    if ask.get("days") is not None:
        rows.append(("when", when(float(ask["days"]))))
    for rival in ask.get("rivals", ()):
        pairs = [(str(effect), str(target)) for effect, target in rival["causes"]]
        least, most = (float(rival.get(k, 0.0)) for k in ("chi_square", "chi_square_at_best"))
        fall = f"chi-square {least:.3g}"
        if most > 2.0 * least:
            fall += f" or {most:.3g}, by what it is"
        told = _TOLD.get(rival.get("told", ""), "tells it from")
        rows.append((told, f"{_set_words(pairs)} ({fall})"))
    return rows
