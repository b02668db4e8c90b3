"""The reducers that can be named: catalogue files that ship with picchio, and the user's own."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from functools import cache
from importlib.resources import files
from pathlib import Path

from picchio.core.errors import InputError
from picchio.core.model import Positive, StrictModel
from picchio.core.toml import parse_toml
from picchio.fatigue.reducer import Kind, Reducer

REDUCER_FORMAT = "picchio-reducers/1"
_RPM = 2.0 * math.pi / 60.0


class ReducerEntry(StrictModel):
    """One reducer of a catalogue file; torques in N m."""

    name: str
    ratio: Positive | None = None
    rated_torque: Positive
    repeated_peak_torque: Positive
    momentary_peak_torque: Positive
    average_torque: Positive | None = None
    ratcheting_torque: Positive | None = None
    source: str | None = None


class ReducerFile(StrictModel):
    """A catalogue file: what its entries share, and the entries."""

    manufacturer: str
    kind: Kind
    rated_speed_rpm: Positive
    rated_life_hours: Positive
    source: str
    reducer: tuple[ReducerEntry, ...]


def reducer_names() -> tuple[str, ...]:
    """The names of the reducers that ship with picchio."""
    return tuple(_shipped())


def load_reducer(name: str, *, catalogues: Iterable[str | Path] = ()) -> Reducer:
    """A reducer by its catalogue name.

    A cycloidal reducer's ratings hold for every ratio, so its name may carry one: "RV-42N-126".

    Args:
        name: as in the catalogue.
        catalogues: further files (`picchio-reducers/1`); they win over those that ship.

    Raises:
        InputError: an unknown name, or a catalogue file that is missing or wrong.
    """
    known = dict(_shipped())
    for path in catalogues:
        known |= read_reducers(path)
    if name in known:
        return known[name]
    found = re.fullmatch(r"(.+?)-(\d+(?:\.\d+)?)", name)
    if found and found.group(1) in known and known[found.group(1)].ratio is None:
        values = {f: getattr(known[found.group(1)], f) for f in Reducer.__dataclass_fields__}
        return Reducer(**{**values, "name": name, "ratio": float(found.group(2))})
    raise InputError("no such reducer", key="reducer", value=name, choices=known)


def read_reducers(path: str | Path) -> dict[str, Reducer]:
    """The reducers of a catalogue file, by name.

    Raises:
        InputError: missing, not TOML, an unknown format, misspelt keys, wrong values, or a name
            that stands there twice.
    """
    content = parse_toml(path, ReducerFile, format=REDUCER_FORMAT)
    found: dict[str, Reducer] = {}
    for entry in content.reducer:
        if entry.name in found:
            raise InputError("stands here twice", file=path, key="reducer.name", value=entry.name)
        values = entry.model_dump(exclude={"source"})
        found[entry.name] = Reducer(
            **values,
            kind=content.kind,
            manufacturer=content.manufacturer,
            rated_speed=content.rated_speed_rpm * _RPM,
            rated_life=content.rated_life_hours * 3600.0,
            source=entry.source or content.source,
        )
    return found


@cache
def _shipped() -> dict[str, Reducer]:
    folder = Path(str(files("picchio.fatigue"))) / "data" / "reducers"
    found: dict[str, Reducer] = {}
    for path in sorted(folder.glob("*.toml")):
        found |= read_reducers(path)
    return found
