"""Every file format with its keys: type, unit, default and meaning.

The keys of TOML files come from the tables that check them (`picchio.core.toml.StrictModel`): type,
bounds and default from the fields, unit and meaning from the "Attributes" section of the table's
docstring. JSON outputs and data files, which no table checks, are described in `contracts.toml`.
"""

from __future__ import annotations

import inspect
import json
import re
import tomllib
import typing
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import cache
from importlib.resources import files
from typing import Any, ClassVar

from pydantic import BaseModel

from picchio.campaign import tables as campaign
from picchio.campaign.channels import FRF_KINDS, LOADING_KINDS, kinds
from picchio.campaign.importing import mapping
from picchio.core.errors import InputError
from picchio.core.html import sheet
from picchio.core.results import TableResult
from picchio.core.toml import leaf_types
from picchio.excitation.table import ExcitationTable, catalogue
from picchio.fatigue.sn import library as sn_library
from picchio.prediction import plan
from picchio.robot.annotations import sidecar
from picchio.robot.drives import reducer
from picchio.robot.loading import saved_model
from picchio.studies import tasks
from picchio.studies.maps.files import EXTRA, VARIABLES

FORMAT = "picchio-formats/1"

# A unit at the start of a description: "N m/rad (N/m for a prismatic joint), ...".
_UNITS = ("1", "N", "m", "s", "kg", "rad", "Pa", "Hz", "rpm", "h", "days", "cycles", "deg C", "N m",
          "N/m", "N m/rad", "kg m^2", "m/s", "m/s^2", "rad/s")  # fmt: skip
_SYMBOL = f"(?:{'|'.join(map(re.escape, _UNITS))})"
_UNIT = re.compile(rf"({_SYMBOL}(?: or {_SYMBOL})?(?: \([^)]*\))?), (.+)")
_ENTRY = re.compile(r"([A-Za-z_][\w, ]*): (.*)")


@dataclass(frozen=True)
class Key:
    """One key of a file.

    Attributes:
        path: dotted, such as "operation[].name"; `[]` repeats, `<name>` is yours to choose.
        type: what may stand there, with its bounds or choices.
        unit: SI; "1" for a pure number, empty where a unit makes no sense.
        default: as JSON would have it; empty where there is none.
        required: whether the file is refused without it; for outputs, whether it is always there.
        meaning: in a line or two.
    """

    path: str
    type: str
    unit: str
    default: str
    required: bool
    meaning: str


@dataclass(frozen=True)
class FileFormat:
    """One file format.

    Attributes:
        name: short, as `picchio formats NAME` takes it.
        format: what the file's `format` key says; empty for files without one.
        kind: "TOML", "JSON", "CSV" or "netCDF or Zarr".
        role: "input" (people write it), "output" (a command writes it) or "both".
        meaning: what the file is for.
        command: commands that read or write it.
        keys: in the order of the file.
    """

    name: str
    format: str
    kind: str
    role: str
    meaning: str
    command: str
    keys: tuple[Key, ...]


@dataclass(frozen=True, repr=False)
class FormatList(TableResult):
    """All formats, or one of them; its table is one row a key.

    Attributes:
        formats: inputs first.
    """

    LACKS: ClassVar = {"plot": "it is a list to read", "show": "it is a list to read"}

    INDEX = ""

    formats: tuple[FileFormat, ...]

    def _headline(self) -> str:
        return f"{len(self.formats)} formats: {', '.join(entry.name for entry in self.formats)}"

    def _content(self) -> dict[str, Any]:
        return {"format": FORMAT, "formats": self.formats}

    def _rows(self) -> list[dict[str, Any]]:
        return [{"name": f.name, **asdict(key)} for f in self.formats for key in f.keys]

    def _repr_html_(self) -> str:
        if len(self.formats) == 1:
            only = self.formats[0]
            rows = [(k.path, k.type, k.unit, k.default, k.meaning) for k in only.keys]
            columns = ("key", "type", "unit", "default", "meaning")
            return sheet(f"{only.name}: {only.meaning}", {"format": only.format}, columns, rows)
        lines = [(f.name, f.format, f.kind, f.command, f.meaning) for f in self.formats]
        return sheet(
            f"{len(lines)} formats", None, ("name", "format", "kind", "command", "meaning"), lines
        )


def formats(name: str | None = None) -> FormatList:
    """Every file that picchio reads or writes, with all its keys.

    Args:
        name: of one format, such as "task" or "picchio-task/1"; all of them if not given.

    Returns:
        their descriptions.

    Raises:
        InputError: no such format.
    """
    known = _known()
    if name is None:
        return FormatList(known)
    found = [entry for entry in known if name in (entry.name, entry.format)]
    if not found:
        raise InputError("no such format", value=name, choices=[entry.name for entry in known])
    return FormatList(tuple(found[:1]))


# TOML files: format, table, commands, meaning.
_TABLES: tuple[tuple[str, type[BaseModel], str, str], ...] = (
    (tasks.FORMAT, tasks.TaskTable, "assess, place, view, diagnose",
     "the work: blows, directions and the poses or points where rivets are set"),
    (sidecar.FORMAT, sidecar.Sidecar, "--flex; annotate, identify",
     "what a URDF does not say: stiffness, damping, shafts, reducers, tool, gun"),
    (campaign.FORMAT, campaign.CampaignTable, "check, diagnose, identify",
     "campaign.toml: measured records and what was programmed"),
    (plan.FORMAT, plan.Plan, "simulate; diagnose --plan",
     "a test to be done: poses, directions, sensors with their noise"),
    (plan.FORMAT, plan.TestPlan, "plan",
     "tests for stiffness, done by hand: what is set, pulled and read"),
    (mapping.FORMAT, mapping.Mapping, "import, count",
     "how the series of a measured file become channels"),
    (saved_model.FORMAT, saved_model.SavedModel, "ROBOT; diagnose --model",
     "a robot, its sidecar and the effects that a diagnosis found"),
    (sn_library.SN_FORMAT, sn_library.SNCurveFile, "--sn-curve; fit-sn --out",
     "an S-N curve in shear"),
    (reducer.REDUCER_FORMAT, reducer.ReducerFile, "--reducers",
     "a maker's catalogue of reducers"),
)  # fmt: skip


@cache
def _known() -> tuple[FileFormat, ...]:
    tables = []
    for format, table, command, meaning in _TABLES:
        name = format.removeprefix("picchio-").partition("/")[0]
        name = "tests" if table is plan.TestPlan else name
        keys = (_format_key(format), *_keys(table))
        tables.append(FileFormat(name, format, "TOML", "input", meaning, command, keys))
    return (*tables, _record(), *_tests(), *_contracts(), _map())


def _format_key(format: str) -> Key:
    return Key("format", f'"{format}"', "", "", True, "which format, and which version of it")


def _record() -> FileFormat:
    """A record's columns, from the kinds of channels that are registered."""
    keys = [Key("time", "column", "s", "", True, "uniform; 0 is the first edge of the first blow")]
    keys += [
        Key(kind.pattern, "column", " or ".join(kind.units), "", False, kind.meaning)
        for kind in kinds()
    ]
    return FileFormat(
        "record", "", "CSV or Parquet", "input",
        "one measured record; each column's header is `channel [unit]`",
        "check, diagnose, identify", tuple(keys),
    )  # fmt: skip


def _tests() -> Iterator[FileFormat]:
    """The columns of records whose rows are no samples in time."""
    for name, of, meaning, needed in (
        ("loadings", LOADING_KINDS, 'a record of the kind "static", a row a loading', ()),
        (
            "frf",
            FRF_KINDS,
            'a record of the kind "frf", a row a line',
            ("frequency", "real", "imag"),
        ),
    ):
        keys = [
            Key(kind.pattern, "column", " or ".join(kind.units), "", kind.name in needed,
                kind.meaning)
            for kind in of
        ]  # fmt: skip
        yield FileFormat(
            name, "", "CSV or Parquet", "input", f"{meaning}; each header is `channel [unit]`",
            "identify", tuple(keys),
        )  # fmt: skip


def _map() -> FileFormat:
    keys = [
        Key(name, f"({', '.join(d)})", "" if unit == "1" else unit, "", name not in EXTRA, meaning)
        for name, (d, unit, meaning) in VARIABLES.items()
    ]
    return FileFormat(
        "map", "picchio-map/1", "netCDF or Zarr", "output",
        "a workspace map: one row a point and branch", "map, view --map", tuple(keys),
    )  # fmt: skip


def _contracts() -> Iterator[FileFormat]:
    text = (files("picchio.reference") / "contracts.toml").read_text(encoding="utf-8")
    content = tomllib.loads(text)
    shared = content.pop("shared")
    for name, entry in content.items():
        kind, role = entry.get("kind", "JSON"), entry.get("role", "output")
        format = entry.get("format", f"picchio-{name}/1" if kind == "JSON" else "")
        keys = [_format_key(format)] if format else []
        for path, line in entry["keys"].items():
            keys += [_contract_key(*found) for found in _expanded(path, line, shared)]
        yield FileFormat(name, format, kind, role, entry["meaning"], entry["command"], tuple(keys))


def _expanded(path: str, line: str, shared: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """A described path, or the paths of the group that its line names."""
    if not line.startswith("@"):
        yield path.lstrip("."), line
        return
    maybe = line.startswith("@?")  # a group that is not always there
    for tail, inner in shared[line[1:].removeprefix("?")].items():
        for found, text in _expanded(path + tail, inner, shared):
            kind, mark, rest = text.partition("; ")
            yield found, f"{kind.removesuffix('?')}?{mark}{rest}" if maybe else text


def _contract_key(path: str, line: str) -> Key:
    """A line such as "number; rad, largest over the task"; "?" after the type: not always."""
    kind, _, text = line.partition("; ")
    unit, meaning = _split_unit(text)
    return Key(path, kind.removesuffix("?"), unit, "", not kind.endswith("?"), meaning)


def _keys(table: type[BaseModel], before: str = "") -> Iterator[Key]:
    """Every key of a table, tables within it included."""
    meanings, schema = described(table), table.model_json_schema()["properties"]
    # A table's own keys, then those that it shares with others.
    own = [name for name in table.model_fields if name in table.__annotations__]
    for name in dict.fromkeys([*own, *table.model_fields]):
        field = table.model_fields[name]
        key = field.alias or name
        node, path = schema[key], before + key
        unit, meaning = _split_unit(meanings.get(name, ""))
        kind = _type(node)
        if issubclass(table, ExcitationTable) and name == "kind":
            kind = " | ".join(f'"{known}"' for known in catalogue())
        yield Key(path, kind, unit, _default(node), field.is_required(), meaning)
        for tail, inner in (found for arm in leaf_types(field.annotation) for found in _inner(arm)):
            yield from _keys(inner, f"{path}{tail}.")
    if issubclass(table, ExcitationTable):
        yield from _declared(before)


def _declared(before: str) -> Iterator[Key]:
    """Keys of `[excitation]` that only one kind of blow has."""
    for kind, excitation in catalogue().items():
        for name in (*excitation.needed, *excitation.optional):
            if name not in ExcitationTable.model_fields:
                meaning = _split_unit(described(excitation).get(name, f"see {kind}"))
                yield Key(before + name, f'only of "{kind}"', meaning[0], "", False, meaning[1])


def described(table: type) -> dict[str, str]:
    """What the docstrings of a table and its bases say of its keys.

    Args:
        table: a class with an "Attributes" section.

    Returns:
        key -> description, the unit first where there is one.
    """
    found: dict[str, str] = {}
    for kind in reversed(table.__mro__):
        section = inspect.cleandoc(kind.__doc__ or "").partition("\nAttributes:\n")[2]
        names: list[str] = []
        for line in section.splitlines():
            entry = _ENTRY.fullmatch(line.strip())
            if entry and line.startswith("    ") and not line.startswith("     "):
                names = [part.strip() for part in entry[1].split(",")]
                found |= dict.fromkeys(names, entry[2])
            elif line.strip() and names:
                found |= {name: f"{found[name]} {line.strip()}" for name in names}
    return found


def _split_unit(text: str) -> tuple[str, str]:
    match = _UNIT.fullmatch(text.removesuffix("."))
    return (match[1], match[2]) if match else ("", text.removesuffix("."))


def _inner(kind: Any) -> Iterator[tuple[str, type[BaseModel]]]:
    """Tables reached from a type, with what the path to them adds."""
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        yield "", kind
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    tail = "[]" if origin in (list, tuple) else ".<name>" if origin is dict else ""
    if tail:
        for leaf in leaf_types(arguments[-1 if origin is dict else 0]):
            for more, table in _inner(leaf):
                yield tail + more, table


_WORDS = {"number": "number", "integer": "whole number", "string": "text",
          "boolean": "true or false"}  # fmt: skip
_BOUNDS = {"exclusiveMinimum": ">", "minimum": ">=", "exclusiveMaximum": "<", "maximum": "<="}


def _type(node: Mapping[str, Any]) -> str:
    """What a node of a JSON schema allows, in words; null, for keys left out, is not told."""
    if "anyOf" in node:
        arms = [arm for arm in node["anyOf"] if arm.get("type") != "null"]
        return " or ".join(dict.fromkeys(_type(arm) for arm in arms))
    if "$ref" in node:
        return "table"
    choices = node.get("enum", [node["const"]] if "const" in node else [])
    if choices:
        return " | ".join(json.dumps(choice) for choice in choices)
    bounds = [f"{sign} {node[key]:g}" for key, sign in _BOUNDS.items() if key in node]
    least, most = (node.get(f"{end}Items", node.get(f"{end}Length")) for end in ("min", "max"))
    count = f"{least} " if least is not None and least == most else ""
    if least is not None and not count:
        bounds.append(f"at least {least} long")
    kind = node.get("type")
    if kind == "array":
        inner = node.get("prefixItems", [node.get("items")])[0]
        words = f"list of {count}{_plural(_type(inner))}"
    elif kind == "object":
        inner = node.get("additionalProperties")
        words = f"table of {_plural(_type(inner)) if isinstance(inner, dict) else 'any keys'}"
    elif node.get("format") == "date-time":
        words = "date and time"
    else:
        words = _WORDS.get(str(kind), "anything")
    return f"{words} {', '.join(bounds)}".strip()


def _plural(words: str) -> str:
    return re.sub("^(whole number|number|table|list)", r"\1s", words)


def _default(node: Mapping[str, Any]) -> str:
    """The default as TOML would have it; empty for none and for tables."""
    value = node.get("default")
    if value in (None, "", []) or isinstance(value, dict):
        return ""
    if isinstance(value, list):
        return f"[{', '.join(f'{part:g}' for part in value)}]"
    return f"{value:g}" if isinstance(value, float) else json.dumps(value)


def sections(entry: FileFormat) -> Mapping[str, tuple[Key, ...]]:
    """A format's keys by the table that they stand in.

    Args:
        entry: a format.

    Returns:
        the table's path ("" for the top of the file) -> its keys, in order.
    """
    found: dict[str, list[Key]] = {}
    for key in entry.keys:
        nested = entry.kind in ("TOML", "JSON")
        found.setdefault(key.path.rpartition(".")[0] if nested else "", []).append(key)
    return {path: tuple(keys) for path, keys in found.items()}
