"""`picchio-model/1`: a robot, its sidecar, and the effects that a diagnosis found."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import Field

from picchio.core.errors import InputError
from picchio.core.files import relative_name
from picchio.core.toml import Finite, Name, StrictModel, parse_toml, read_toml

FORMAT = "picchio-model/1"


class EffectTable(StrictModel):
    """One `[[effect]]`.

    Attributes:
        effect: a name from `picchio effects`.
        target: the joint, link, axis, channel group, "tool" or "robot" that it acts on.
        parameters: SI values by name; those left out are neutral.
        hidden: by record, the numbers that differ from record to record.
    """

    effect: Name
    target: Name
    parameters: dict[str, Finite] = Field(default_factory=dict)
    hidden: dict[str, list[Finite]] = Field(default_factory=dict)


class SavedModel(StrictModel):
    """A saved model as it is written.

    Attributes:
        robot: a name from `picchio robots`, or a URDF relative to this file.
        flex: sidecar, relative to this file.
        tool: frame that carries the tool.
        gravity_stiffness: whether the fit added gravity's stiffness dg/dq to the springs'; every
            command then does so, too, unless told otherwise.
        notes: free text.
        provenance: where the model comes from; any keys.
        values: of joints, in place of those of the robot's files: [values.NAME] stiffness = ...
        carries: what the tool's frame carries, in place of what the files say.
        effect: how the real robot differs from its files, one table for each effect.
    """

    robot: Name
    flex: Name | None = None
    tool: Name | None = None
    gravity_stiffness: bool | None = None
    notes: str | None = None
    provenance: dict[str, Any] | None = None
    values: dict[str, dict[str, Any]] = Field(default_factory=dict)
    carries: dict[str, Any] | None = None
    effect: list[EffectTable] = Field(default_factory=list)


def is_saved_model(robot: str | Path) -> bool:
    """Whether a file says that it is a saved model, of whatever version."""
    path = Path(robot)
    if path.suffix != ".toml" or not path.is_file():
        return False
    try:
        return str(read_toml(path).get("format", "")).startswith(FORMAT.partition("/")[0])
    except InputError:  # what is wrong with it, others say
        return False


def read_saved_model(path: Path) -> SavedModel:
    """Read a saved model; robot and sidecar become paths where they lie beside it.

    Raises:
        InputError: syntax, an unknown format, misspelt keys.
    """
    found = parse_toml(path, SavedModel, format=FORMAT)
    changes: dict[str, Any] = {}
    for key in ("robot", "flex"):
        value = getattr(found, key)
        if value is not None and (path.parent / value).exists():
            changes[key] = os.path.normpath(path.parent / value)
    return found.model_copy(update=changes)


def saved_model_text(
    robot: str,
    effects: Sequence[Mapping[str, Any]],
    *,
    flex: str | Path | None = None,
    tool: str | None = None,
    gravity_stiffness: bool | None = None,
    notes: str | None = None,
    folder: Path | None = None,
    provenance: Mapping[str, Any] | None = None,
    values: Mapping[str, Mapping[str, object]] | None = None,
    carries: Mapping[str, object] | None = None,
) -> str:
    """A saved model as TOML.

    Args:
        robot: a name or the path of a URDF.
        effects: tables with effect, target, parameters and, where needed, hidden.
        flex: sidecar.
        tool: frame that carries the tool.
        gravity_stiffness: what the fit assumed.
        notes: free text.
        folder: where the file will stand; paths are written relative to it.
        provenance: where it comes from.
        values: see `load_robot`.
        carries: likewise.
    """
    import tomlkit

    document = tomlkit.document()
    document["format"] = FORMAT
    document["robot"] = _relative(robot, folder)
    if flex is not None:
        document["flex"] = _relative(str(flex), folder)
    given = {"tool": tool, "gravity_stiffness": gravity_stiffness, "notes": notes,
             "provenance": provenance, "values": values or None, "carries": carries}  # fmt: skip
    for key, value in given.items():
        if value is not None:
            document[key] = value
    tables = []
    for effect in effects:
        table = {"effect": effect["effect"], "target": effect["target"]}
        for key in ("parameters", "hidden"):
            if effect.get(key):
                table[key] = tomlkit.inline_table()
                table[key].update(effect[key])
        tables.append(table)
    if tables:
        document["effect"] = tables
    return tomlkit.dumps(document)


def _relative(name: str, folder: Path | None) -> str:
    return relative_name(name, folder or Path()) if Path(name).exists() else name
