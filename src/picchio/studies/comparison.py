"""Robots, tasks, models or saved results side by side: what differs in them, and what of it comes.

Everything that can be compared becomes what `--json` writes of it: a robot, a model, a task or a
sidecar by an assessment, a saved result as it is. Two such contents are then compared key by key.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from picchio.core import spoken
from picchio.core.errors import InputError
from picchio.core.json_files import read_json
from picchio.core.listing import Key, Listing
from picchio.core.provenance import provenance
from picchio.core.results import Result, TableResult, plain
from picchio.core.toml import read_toml
from picchio.model.model import Model, ModelLike
from picchio.robot.loading.load import load_robot
from picchio.robot.loading.objects import RobotLike
from picchio.robot.units import units_of
from picchio.studies.assessment.result import Assessment
from picchio.studies.assessment.run import assess
from picchio.studies.default_task import task_of

FORMAT = "picchio-comparison/1"
_FEW = 4  # values of a table that are shown in its row
_DIGITS = 4  # one more than elsewhere: what differs shall look different
_SAME = 1e-9  # relative: what differs by less is rounding
_VERSION = re.compile(r"picchio-[a-z-]+/1")
# Not results: what entered and how, prose, and what is told pose by pose.
_LEFT_OUT = {"format", "inputs", "provenance", "operations", "origins", "assumptions", "warnings",
             "steady_state", "method_terms", "doubts", "tool", "not_assessed"}  # fmt: skip
_PROSE = {"name", "source", "assumptions", "unverified", "warning"}
_FIGURES = {
    "status", "governed_by", "joint", "margin", "rivets_to_failure", "peak_deflection",
    "peak_torque", "peak_shear_stress", "utilisation", "yield_utilisation", "reducer_utilisation",
    "reducer_governed_by", "damage_per_rivet", "p10", "p50", "p90", "margin_interval",
    "utilisation_interval", "yield_utilisation_interval", "reducer_utilisation_interval", "force",
    "force_interval",
}  # fmt: skip
_UNITS = {
    **Assessment.UNITS, "stiffness": "N m/rad", "force": "N", "period": "s", "width": "s",
    "preload": "N", "mass": "kg", "radius": "m", "length": "m", "shear_modulus": "Pa",
}  # fmt: skip
_UNITS = {key: unit for key, unit in _UNITS.items() if unit != "1"}


@dataclass(frozen=True)
class Compared:
    """One of the things compared.

    Attributes:
        name: short, and no other has it.
        source: the robot, task or file that was given.
        format: of its result.
        content: the result as `--json` writes it.
    """

    name: str
    source: str
    format: str
    content: Mapping[str, Any]

    @property
    def verdict(self) -> Mapping[str, Any]:
        """Status, part, joint, margin and reasons; empty where the result has no verdict."""
        found = self.content.get("verdict")
        return found if isinstance(found, Mapping) else {}


@dataclass(frozen=True)
class Difference:
    """A key that is not the same in all.

    Attributes:
        key: its path in the JSON, entries of lists by their name.
        unit: where it is known.
        values: one each; None where there is none.
        shown: the same as people read them.
        table: a table that some lack; the values say who has it.
    """

    key: str
    unit: str
    values: tuple[Any, ...]
    shown: tuple[str, ...]
    table: bool = False

    @property
    def label(self) -> str:
        """The key in words."""
        *where, what = self.key.removeprefix("joints.").removeprefix("sidecar.").split(".")
        if self.table:
            return " ".join([*where, what])
        what = what.replace("_", " ") + (f", {self.unit}" if self.unit else "")
        return f"{' '.join(where)}: {what}" if where else what

    @property
    def ratios(self) -> tuple[float, ...]:
        """Each value over the first; NaN where these are no numbers."""
        first = self.values[0]
        return tuple(v / first if _number(v) and _number(first) and first else math.nan
                     for v in self.values)  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """The row as it is written.

        Returns:
            key, unit, values, and their ratios to the first.
        """
        return {"key": self.key, "unit": self.unit, "values": list(self.values),
                "ratios": list(self.ratios)}  # fmt: skip


@dataclass(frozen=True, repr=False)
class Comparison(TableResult):
    """What differs.

    Attributes:
        items: what was compared, the first being the reference of every ratio.
        inputs: what entered differently.
        results: what came out differently.
        notes: what could not be compared, a sentence each.
        provenance: versions and hashes.
    """

    INDEX = "key"
    LACKS: ClassVar = {
        "plot": "its rows have different units",
        "show": "it is about several robots",
    }

    PAGE = "visuals.report.comparison:comparison_page"

    items: tuple[Compared, ...]
    inputs: tuple[Difference, ...]
    results: tuple[Difference, ...]
    notes: tuple[str, ...]
    provenance: Mapping[str, Any]

    @property
    def entered(self) -> tuple[Difference, ...]:
        """The inputs that differ; a table that one of them lacks, such as a joint's, in one row."""
        sides = [set(_branches(item.content.get("inputs") or {})) for item in self.items]
        rows: dict[str, Difference] = {}
        for row in self.inputs:
            parts = row.key.split(".")
            ways = (".".join(parts[:k]) for k in range(1, len(parts)))
            lacking = next((w for w in ways if not all(w in side for side in sides)), None)
            if lacking is None:
                rows[row.key] = row
            elif lacking not in rows:
                there = tuple(lacking in side for side in sides)
                shown = tuple(_short(item.content.get("inputs") or {}, lacking)
                              for item in self.items)  # fmt: skip
                rows[lacking] = Difference(lacking, "", there, shown, table=True)
        return tuple(rows.values())

    @property
    def figures(self) -> tuple[Difference, ...]:
        """The results that matter most; all of them but of assessments."""
        if "picchio-assessment/1" not in {item.format for item in self.items}:
            return self.results
        return tuple(row for row in self.results if row.key.rpartition(".")[2] in _FIGURES)

    @property
    def bottom_line(self) -> str:
        """How each fares and which is furthest from a limit; "" without two verdicts."""
        judged = [item for item in self.items if item.verdict]
        if len(judged) < 2:
            return ""
        told = ", ".join(f"{i.name}: {_word(i.verdict)}" for i in judged)
        known: dict[str, float] = {
            i.name: i.verdict["margin"] for i in judged if _number(i.verdict.get("margin"))
        }
        if len(known) < len(judged) or len(set(known.values())) == 1:
            return told
        best = max(known, key=lambda name: known[name])
        least = min(known, key=lambda name: known[name])
        ratio = spoken.number(known[best] / known[least])
        return f"{told}; the margin of {best} is {ratio} times that of {least}"

    def _rows(self) -> list[dict[str, Any]]:
        names = [item.name for item in self.items]
        return [
            {"key": row.key, "unit": row.unit, **dict(zip(names, row.values, strict=True))}
            for row in (*self.inputs, *self.results)
        ]

    def _headline(self) -> str:
        names = ", ".join(item.name for item in self.items)
        return self.bottom_line or f"{names}: {len(self.figures)} results differ"

    def _listing(self, rows: Sequence[Difference] | None = None, title: str = "") -> Listing:
        """What differs: some rows, or all that matter; of two items their ratio, too."""
        columns: list[tuple[str, Key]] = [("", "label")]
        for k, item in enumerate(self.items):
            columns.append((item.name, lambda row, k=k: row.shown[k]))  # type: ignore[misc]
        if len(self.items) == 2:
            columns.append(("ratio", _ratio))
        shown = (*self.entered, *self.figures) if rows is None else rows
        return Listing.of(title or "Comparison", shown, columns, note=" ".join(self.notes))

    def _content(self) -> dict[str, Any]:
        items = [
            {"name": i.name, "source": i.source, "format": i.format, "verdict": i.verdict or None}
            for i in self.items
        ]
        return {"format": FORMAT, "items": items, "inputs": self.inputs, "results": self.results,
                "notes": self.notes, "provenance": self.provenance}  # fmt: skip


def _ratio(row: Difference) -> str:
    return "" if math.isnan(row.ratios[1]) else spoken.number(row.ratios[1], least=0.0)


def compare(
    *items: ModelLike | Result | Mapping[str, Any],
    task: str | Path | None = None,
    robot: RobotLike | None = None,
    flex: str | Path | None = None,
    tool: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Comparison:
    """Robots, models, tasks, guns or saved results side by side.

    Args:
        *items: at least two: results of picchio or the JSON files of them, all of one format; or
            robots as `load_robot` takes them, and files of tasks and sidecars, which are assessed.
        task: for robots, models and sidecars; each robot's example task if not given, else
                an assumed one.
        robot: for tasks and sidecars.
        flex: sidecar of `robot`.
        tool: the frame that carries the tool.
        progress: called with (done, total) items.

    Returns:
        what differs in the inputs, and what in the results.

    Raises:
        InputError: fewer than two, an unknown kind of file, results of different formats, a task
            or sidecar without a robot.
    """
    if len(items) < 2:
        raise InputError("there must be at least two to compare", key="items", value=len(items))
    if flex is not None and robot is None:
        raise InputError("belongs to --robot", key="flex", value=str(flex))
    found: list[tuple[str, Mapping[str, Any]]] = []
    for k, item in enumerate(items):
        found.append(_content_of(item, task, robot, flex, tool))
        if progress is not None:
            progress(k + 1, len(items))
    formats = [str(content["format"]) for _, content in found]
    if len(set(formats)) > 1:
        raise InputError("only results of one format can be compared", key="items",
                         value=", ".join(dict.fromkeys(formats)))  # fmt: skip
    names = _names([source for source, _ in found])
    compared = tuple(
        Compared(name, source, format, content)
        for name, (source, content), format in zip(names, found, formats, strict=True)
    )
    files = [item for item in (*items, task, flex) if isinstance(item, (str, Path))]
    return Comparison(
        items=compared,
        inputs=_differences([dict(leaves(i.content.get("inputs") or {})) for i in compared]),
        results=_differences([dict(leaves(_results(i.content))) for i in compared]),
        notes=tuple(
            f"{i.name} does not say what entered it: an older picchio wrote it"
            for i in compared if not i.content.get("inputs") and i.format == "picchio-assessment/1"
        ),
        provenance=provenance([Path(file) for file in files if Path(file).is_file()]),
    )  # fmt: skip


def _content_of(
    item: ModelLike | Result | Mapping[str, Any],
    task: str | Path | None,
    robot: RobotLike | None,
    flex: str | Path | None,
    tool: str | None,
) -> tuple[str, Mapping[str, Any]]:
    """What an item is called, and its result."""
    if isinstance(item, Result):
        item = item.to_dict()
    if isinstance(item, Mapping):
        return str(item.get("robot", item["format"])), _known(plain(item), None)
    if not isinstance(item, (str, Path)):
        model = Model.of(item)
        return model.robot.name, assess(model, task).to_dict()
    path = Path(item)
    if path.suffix == ".json":
        return str(path), _known(read_json(path, "result", ["picchio-assessment/1"]), path)
    kind = str(read_toml(path).get("format", "")) if path.suffix == ".toml" else ""
    base, side, work = robot, flex, task
    if kind.startswith("picchio-task/"):
        work = path
    elif kind.startswith("picchio-sidecar/"):
        side = path
    else:  # a robot, or a saved model
        base, side = item, None
    if base is None:
        raise InputError("needs the robot that it is for", file=path, hint="name one with --robot")
    loaded = load_robot(base, flex=side, tool=tool)
    return str(item), assess(loaded, task_of(loaded, work)).to_dict()


def _known(content: Mapping[str, Any], path: Path | None) -> Mapping[str, Any]:
    if not _VERSION.fullmatch(str(content.get("format"))):
        raise InputError("unknown version", file=path, key="format", value=content.get("format"),
                         choices=["picchio-assessment/1", "..."])  # fmt: skip
    return content


def _names(sources: Sequence[str]) -> list[str]:
    """Short names, none twice: of a file its stem, if that will do."""
    short = [Path(source).stem if Path(source).suffix else source for source in sources]
    names = short if len(set(short)) == len(short) else list(sources)
    seen: dict[str, int] = {}
    for name in names:
        seen[name] = seen.get(name, 0) + 1
    count = dict.fromkeys(names, 0)
    for k, name in enumerate(names):
        if seen[name] > 1:
            count[name] += 1
            names[k] = f"{name} ({count[name]})"
    return names


def _results(content: Mapping[str, Any]) -> dict[str, Any]:
    kept = {key: value for key, value in content.items() if key not in _LEFT_OUT}
    if isinstance(verdict := kept.get("verdict"), Mapping):
        kept["verdict"] = {key: value for key, value in verdict.items() if key not in _LEFT_OUT}
    return kept


def _short(content: Mapping[str, Any], table: str) -> str:
    """The values of a small table, such as an effect's; "-" where there is none."""
    own = {key.removeprefix(f"{table}."): value for key, value in leaves(content)
           if key.startswith(f"{table}.")}  # fmt: skip
    told = [f"{key.removeprefix('parameters.')} {_text(value)}" for key, value in own.items()
            if key not in ("effect", "target")]  # fmt: skip
    return "-" if not own else ", ".join(told) if 0 < len(told) <= _FEW else "given"


def leaves(content: Any, before: str = "") -> Iterator[tuple[str, Any]]:
    """Every leaf of a content.

    Args:
        content: as `json.dumps` takes it.
        before: the path to it.

    Yields:
        (path, value); entries of lists by their name, lists of numbers whole.
    """
    if isinstance(content, Mapping):
        for key, value in content.items():
            yield from leaves(value, f"{before}.{key}" if before else str(key))
    elif isinstance(content, list) and content and isinstance(content[0], Mapping):
        for k, value in enumerate(content):
            name = _name(value) or k + 1
            yield from leaves(value, f"{before}.{name}" if before else str(name))
    else:
        yield before, content


def _name(entry: Any) -> str:
    """What an entry of a list is called: its name or joint, or an effect and its target."""
    if not isinstance(entry, Mapping):
        return ""
    keys = next(
        (keys for keys in (["name"], ["joint"], ["effect", "target"]) if keys[0] in entry), []
    )
    return " ".join(str(entry[key]) for key in keys if key in entry)


def listed(content: Mapping[str, Any]) -> tuple[Difference, ...]:
    """Every value of a content in a row of its own, to be shown.

    Args:
        content: such as an assessment's `inputs`.

    Returns:
        rows with one value each; names, prose and what is not there are left out.
    """
    side = dict(leaves(plain(content)))
    return tuple(
        Difference(
            key, _UNITS.get(key.rpartition(".")[2], ""), (value,), (_shown(key, side, None),)
        )
        for key, value in side.items()
        if value not in (None, "", [], {}) and key.rpartition(".")[2] not in _PROSE
    )


def _branches(content: Any) -> Iterator[str]:
    """The path of every table in the content, empty ones included."""
    for path, value in leaves(content):
        parts = path.split(".")
        if value in ([], {}):
            yield path
        yield from (".".join(parts[:k]) for k in range(1, len(parts)))


def _differences(sides: Sequence[Mapping[str, Any]]) -> tuple[Difference, ...]:
    keys = dict.fromkeys(key for side in sides for key in side)
    rows = []
    for key in keys:
        values = tuple(None if side.get(key) == "" else side.get(key) for side in sides)
        if key.rpartition(".")[2] == "name" or all(_same(values[0], value) for value in values[1:]):
            continue
        shown = tuple(_shown(key, side, values[0]) for side in sides)
        unit = next((_unit(key, side) for side in sides if key in side), "")
        rows.append(Difference(key, unit, values, shown))
    return tuple(rows)


def _unit(key: str, side: Mapping[str, Any]) -> str:
    """A key's unit; of a joint's keys by the kind that stands beside them."""
    before, _, last = key.rpartition(".")
    unit = _UNITS.get(last, "")
    kind = side.get(f"{before}.kind")
    return units_of(kind).of(unit) if unit and kind in ("revolute", "prismatic") else unit


def _word(verdict: Mapping[str, Any]) -> str:
    """A verdict in a word or two, as its headline begins."""
    return str(verdict.get("headline") or verdict["status"]).partition(".")[0].lower()


def _number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _same(one: Any, other: Any) -> bool:
    if _number(one) and _number(other):
        return math.isclose(one, other, rel_tol=_SAME)
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(_same, one, other))
    return bool(one == other)


def _shown(key: str, side: Mapping[str, Any], first: Any) -> str:
    """A value as people read it; of a long list, how much of it is not as in the first."""
    value = side.get(key)
    before, _, last = key.rpartition(".")
    if last == "rivets_to_failure" and side.get(key.replace(last, "estimated")):
        ends = [_shown(key.replace(last, f"life.{end}"), side, None) for end in ("p10", "p90")]
        return " to ".join(ends)  # an estimate is no lone number
    if last in ("rivets_to_failure", "p10", "p50", "p90") and not isinstance(value, list):
        # Null is an unlimited life, if there is a shaft at all.
        known = key in side and side.get(f"{before}.sn_curve", "?") != ""
        return spoken.count(math.inf if known and value is None else value or math.nan)
    if value in (None, ""):
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if last.endswith("_interval") and isinstance(value, list):
        return spoken.between(value)
    if isinstance(value, list):
        if len(value) <= 4 and not any(isinstance(part, list) for part in value):
            return ", ".join(_text(part) for part in value) or "none"
        old = first if isinstance(first, list) else []
        others = sum(k >= len(old) or not _same(old[k], part) for k, part in enumerate(value))
        count = f"{len(value)} {'entry' if len(value) == 1 else 'entries'}"
        return count + (f", {others} of them other" if others and old else "")
    return _text(value)


def _text(value: Any) -> str:
    return spoken.number(value, _DIGITS) if isinstance(value, float) else str(value)
