"""The life that a diagnosis tells, as rows of a report's tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from picchio.diagnosis.result import Diagnosis
from picchio.studies.verdict import format_count
from picchio.view.report.page import number, percent, words

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
