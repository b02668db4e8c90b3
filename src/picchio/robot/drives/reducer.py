"""Reducers: their ratings, the torque limits that bind at standstill, and the catalogue files.

A catalogue life is that of rolling contacts that turn: the wave generator's bearing of a
strain-wave gear, the crank's roller bearings of a cycloidal one. A joint at rest under
blows turns nothing: its contacts fret in one spot (false brinelling), which no catalogue covers. So
for percussive work the check that decides is the peak torque, gravity and vibration together,
against the limit for repeated peaks. A blow is part of the duty, not an accident: the limit for
momentary peaks is for emergencies only.

The rated torque is no limit at standstill: it is that at which the rated life holds at the rated
speed (Nabtesco, RV manual, glossary, "rated service life", manualshive.com/en/manual/nabtesco/
rv-rh-e-series/3113236?page=8; Harmonic Drive SE, CHA manual 1018854, glossary, "nominal service
life", manualshive.com/en/manual/harmonic-drive/cha-14a-e/3973040?page=88). What is held is judged
by the limit for the average torque where the catalogue has one, and by no limit of its own where it
has none: the peak contains it. Makers weigh the average of a duty with the speed, so standing still
would not count in it at all: to take what is held for the average is on the safe side.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from difflib import SequenceMatcher
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from picchio.core.errors import InputError
from picchio.core.toml import Positive, StrictModel, parse_toml
from picchio.robot.joint import Stiffness, StiffnessCurve
from picchio.robot.ratings import Ratings, TorqueLimit

Kind = Literal["strain-wave", "cycloidal"]

REDUCER_FORMAT = "picchio-reducers/1"
_RPM = 2.0 * math.pi / 60.0
# A life beyond that, h, is none that anybody states.
_Hours = Annotated[float, Field(gt=0, le=1e9, allow_inf_nan=False, strict=True)]


class OutputBearing(StrictModel):
    """The bearing between a reducer's output and its housing.

    Attributes:
        pitch_diameter: m, of the circle on which the rollers' centres lie.
        static_load_rating: N, C0 by ISO 76.
        permissible_moment: N m, tilting moment that the catalogue allows.
    """

    pitch_diameter: Positive
    static_load_rating: Positive
    permissible_moment: Positive


class ReducerEntry(StrictModel):
    """One reducer of a catalogue file; every torque is at the output.

    Attributes:
        name: as in the catalogue.
        ratio: 1, input turns for one output turn; may be left out for cycloidal reducers.
        rated_torque: N m, for which the life is stated.
        repeated_peak_torque: N m, limit of peaks that belong to the duty.
        momentary_peak_torque: N m, limit for emergencies.
        average_torque: N m, limit of the mean torque.
        ratcheting_torque: N m, at which teeth skip.
        stiffness_curve: of a strain-wave gear, with its input held.
        stiffness: N m/rad, torsional rigidity, of a gear without a curve (most cycloidal ones).
        lost_motion: rad, as the catalogue has it; for information.
        output_bearing: the bearing at the output, where the reducer has one of its own.
        source: where the ratings come from, if not as for the whole file.
    """

    name: str
    ratio: Positive | None = None
    rated_torque: Positive
    repeated_peak_torque: Positive
    momentary_peak_torque: Positive
    average_torque: Positive | None = None
    ratcheting_torque: Positive | None = None
    stiffness_curve: StiffnessCurve | None = None
    stiffness: Stiffness | None = None
    lost_motion: Positive | None = None
    output_bearing: OutputBearing | None = None
    source: str | None = None

    @model_validator(mode="after")
    def _limits_ascend(self) -> Self:
        if self.stiffness is not None and self.stiffness_curve is not None:
            raise ValueError("give stiffness or stiffness_curve, not both")
        if not self.repeated_peak_torque <= self.momentary_peak_torque:
            raise ValueError("momentary_peak_torque must not be below repeated_peak_torque")
        return self


class Reducer(ReducerEntry, Ratings):
    """A reducer's ratings, those of its entry and those that its whole file shares.

    Attributes:
        kind: "strain-wave" or "cycloidal".
        manufacturer: who makes it.
        rated_speed: rad/s at which the rated life is stated: of the input (strain-wave) or of the
            output (cycloidal).
        rated_life: s, life L10 at rated torque and speed.
    """

    kind: Kind
    manufacturer: str
    rated_speed: Positive | None = None
    rated_life: Positive | None = None

    @property
    def spring(self) -> dict[str, Stiffness | StiffnessCurve]:
        """What of a joint's stiffness its catalogue gives, by the sidecar's key; may be empty."""
        own = {"stiffness_curve": self.stiffness_curve, "stiffness": self.stiffness}
        return {key: value for key, value in own.items() if value is not None}

    def _warnings(self, found: Iterable[TorqueLimit]) -> list[str]:
        return [
            f"{self.name}: the catalogue life presumes turning; a joint at rest under "
            "blows risks false brinelling, which no catalogue covers",
            *(f"{self.name}: {text}" for text in super()._warnings(found)),
        ]


class ReducerFile(StrictModel):
    """A catalogue file: what its entries share, and the entries.

    Attributes:
        manufacturer: who makes them.
        kind: strain-wave (ball bearing, life exponent 3) or cycloidal (rollers, 10/3).
        rated_speed_rpm: rpm, at which the life is stated; of the input (strain-wave) or the
            output (cycloidal).
        rated_life_hours: h, life L10 at rated torque and speed.
        source: where the ratings come from.
        unit: what the names of housed units end with.
        component_sets: what stands in its place in the names of component sets, which have the
            same ratings and no output bearing of their own; "" for names without an ending.
        reducer: the reducers, one table for each.
    """

    manufacturer: str
    kind: Kind
    rated_speed_rpm: Positive | None = None
    rated_life_hours: _Hours | None = None
    source: str
    unit: str | None = None
    component_sets: tuple[str, ...] = ()
    reducer: tuple[ReducerEntry, ...]

    @model_validator(mode="after")
    def _sets_of_units(self) -> Self:
        if self.component_sets and not self.unit:
            raise ValueError("component_sets needs unit, the ending that they replace")
        return self


def all_reducers(catalogues: Iterable[str | Path] = ()) -> dict[str, Reducer]:
    """The reducers of the shipped catalogues and of others, by name.

    Args:
        catalogues: further files (`picchio-reducers/1`); they take precedence over those shipped.

    Returns:
        the reducers, the shipped ones first.

    Raises:
        InputError: a catalogue file that is missing or wrong.
    """
    known = dict(_shipped())
    for path in catalogues:
        known |= read_reducers(path)
    return known


def load_reducer(name: str, *, catalogues: Iterable[str | Path] = ()) -> Reducer:
    """A reducer by its catalogue name.

    A cycloidal reducer's ratings hold for every ratio, so its name may carry one: "RV-42N-126".

    Args:
        name: as in the catalogue.
        catalogues: further files (`picchio-reducers/1`); they take precedence over those shipped.

    Returns:
        the reducer.

    Raises:
        InputError: an unknown name, or a catalogue file that is missing or wrong.
    """
    return find_reducer(name, all_reducers(catalogues))


def find_reducer(name: str, known: Mapping[str, Reducer] | None = None) -> Reducer:
    """A reducer by its catalogue name, among those already read.

    Args:
        name: as in the catalogue; a cycloidal one's may carry the ratio.
        known: by name; the shipped ones if None.

    Returns:
        the reducer.

    Raises:
        InputError: an unknown name, with the closest known ones.
    """
    known = _shipped() if known is None else known
    if name in known:
        return known[name]
    found = re.fullmatch(r"(.+?)-(\d+(?:\.\d+)?)", name)
    if found and found.group(1) in known and known[found.group(1)].ratio is None:
        own = known[found.group(1)].model_dump()
        return Reducer(**own | {"name": name, "ratio": float(found.group(2))})
    close = sorted(known, key=lambda other: -SequenceMatcher(None, name, other).ratio())
    raise InputError("no such reducer", key="reducer", value=name, choices=close,
                     hint="a catalogue of your own: --reducers FILE")  # fmt: skip


def read_reducers(path: str | Path) -> dict[str, Reducer]:
    """The reducers of a catalogue file, by name.

    Args:
        path: the file, `picchio-reducers/1`.

    Raises:
        InputError: missing, not TOML, an unknown format, misspelt keys, wrong values, or a
            duplicate name.
    """
    content = parse_toml(path, ReducerFile, format=REDUCER_FORMAT)
    life, speed = content.rated_life_hours, content.rated_speed_rpm
    found: dict[str, Reducer] = {}
    sets: dict[str, Reducer] = {}
    for entry in content.reducer:
        if entry.name in found:
            raise InputError("duplicate name", file=path, key="reducer.name", value=entry.name)
        whole = Reducer(
            **entry.model_dump(exclude={"source"}),
            kind=content.kind,
            manufacturer=content.manufacturer,
            rated_speed=None if speed is None else speed * _RPM,
            rated_life=None if life is None else life * 3600.0,
            source=entry.source or content.source,
        )
        found[entry.name] = whole
        if content.unit and entry.name.endswith(content.unit):
            for ending in content.component_sets:
                name = entry.name.removesuffix(content.unit) + ending
                sets[name] = whole.model_copy(update={"name": name, "output_bearing": None})
    return found | {name: one for name, one in sets.items() if name not in found}


@cache
def _shipped() -> dict[str, Reducer]:
    folder = Path(str(files("picchio.robot.drives"))) / "reducers"
    found: dict[str, Reducer] = {}
    for path in sorted(folder.glob("*.toml")):
        found |= read_reducers(path)
    return found
