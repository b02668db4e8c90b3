"""The stiffness of joints that was measured, and what was fitted to it.

`stiffness/measured.toml` holds the facts with their sources, `stiffness/fitted.json` what `refit`
makes of them: draws of `picchio.robot.drives.hierarchy`.
"""

from __future__ import annotations

import hashlib
import json
import math
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from picchio.robot.drives.hierarchy import Draws, Group, fit
from picchio.robot.drives.predictors import (
    OF_EFFORT,
    OF_STIFFNESS,
    QUANTITIES,
    Predictors,
    places,
    predictors,
)
from picchio.robot.drives.reducer import Reducer, all_reducers

if TYPE_CHECKING:
    from picchio.robot.flexible_robot import FlexibleRobot

Array = NDArray[np.float64]

_TARGETS = 2  # columns of stiffness, an arm's and a wrist's
CLASSES = ("strain-wave", "cycloidal", "planetary")
"""Of drives, as far as the data have them."""
# Of the sampler: with fewer sweeps, scores of robots left out differ from seed to seed by as much
# as the predictors differ among themselves.
_DRAWS, _SWEEPS = 200, 6000
_DIGITS = 3


@dataclass(frozen=True, eq=False)
class MeasuredRobot:
    """A robot of the data.

    Attributes:
        name: of the robot.
        group: (n, 8) logarithms: stiffness in N m/rad of an arm's joints and of a wrist's, then
            the predictors; NaN where not known.
        evidence: how its stiffness was found; "" if it was not.
        source: of what is known of it.
        reducer_share: stiffness of a joint over its reducer's, the joints' geometric mean; None
            where no reducer is known.
    """

    name: str
    group: Group
    evidence: str
    source: str
    reducer_share: float | None

    @property
    def truth(self) -> Array:
        """(n,) ln of the stiffness measured, N m/rad; NaN where it was not."""
        return self.group.values[np.arange(len(self.group.asked)), self.group.asked]


@dataclass(frozen=True, eq=False)
class Fitted:
    """What is known of drives in general.

    Attributes:
        stiffness: draws of its distribution beside those of `OF_STIFFNESS`.
        effort: draws of the effort limit's beside those of `OF_EFFORT`.
        damping: draws of the damping ratio's.
        shares: by robot, stiffness of a joint over its reducer's by the catalogue.
        rings: by place ("first", "arm"), the lowest and highest frequency of a measured joint
            alone, Hz, with the arm stretched, and the number of robots.
    """

    stiffness: Draws
    effort: Draws
    damping: Draws
    shares: tuple[float, ...]
    rings: Mapping[str, tuple[float, float, int]]


def group_of(found: Predictors, stiffness: Array | None = None, kind: int | None = None) -> Group:
    """A robot's table for the fit.

    Args:
        found: of its n joints.
        stiffness: (n,) ln, N m/rad, NaN where not known.
        kind: index of its class in `CLASSES`, or None.
    """
    asked = found.place[:, 1].astype(np.intp)
    columns = np.full((len(asked), _TARGETS), np.nan)
    if stiffness is not None:
        columns[np.arange(len(asked)), asked] = stiffness
    return Group(np.hstack([columns, found.values]), found.place, asked, kind)


def measured_robots(load: Callable[[str], FlexibleRobot]) -> list[MeasuredRobot]:
    """The robots of `measured.toml`.

    Args:
        load: loads a shipped robot by its name, rigid or not.
    """
    return [_measured(entry, load) for entry in _facts()["robot"]]


def stiffness_beside(group: Group, names: Sequence[str] = OF_STIFFNESS) -> Group:
    """A robot's table with the predictors of its stiffness alone.

    Args:
        group: of `group_of`.
        names: of the predictors.
    """
    columns = [0, 1, *(_TARGETS + QUANTITIES.index(name) for name in names)]
    return replace(group, values=group.values[:, columns])


def effort_beside(group: Group) -> Group:
    """A robot's table with its effort limits as what is asked for, beside their predictors.

    Args:
        group: of `group_of`.
    """
    columns = [_TARGETS + QUANTITIES.index(name) for name in ("effort", *OF_EFFORT)]
    nothing = np.zeros_like(group.asked)
    return Group(group.values[:, columns], group.place, nothing)


def fit_stiffness(
    robots: Sequence[MeasuredRobot], names: Sequence[str] = OF_STIFFNESS, seed: int = 0
) -> Draws:
    """The distribution of stiffness beside the predictors'.

    Args:
        robots: of the data, or some of them.
        names: of the predictors.
        seed: of the chain.
    """
    groups = [stiffness_beside(robot.group, names) for robot in robots]
    return fit(groups, classes=len(CLASSES), class_spread=class_spread(), draws=_DRAWS,
               sweeps=_SWEEPS, seed=seed)  # fmt: skip


def refit(robots: Sequence[MeasuredRobot]) -> Fitted:
    """Fit anew.

    Args:
        robots: of the data.

    Returns:
        the distributions, rounded as the file has them.
    """
    return Fitted(
        _rounded(fit_stiffness(robots)),
        _rounded(fit([effort_beside(one.group) for one in robots], draws=_DRAWS, sweeps=_SWEEPS)),
        _rounded(fit(damping_groups(), draws=_DRAWS, sweeps=_SWEEPS)),
        tuple(robot.reducer_share for robot in robots if robot.reducer_share is not None),
        {place: _rings(robots, place) for place in ("first", "arm")},
    )


def damping_groups() -> list[Group]:
    """The robots of which damping ratios were measured: ln of the ratios, (n, 1)."""
    return [
        Group(np.log(np.array(entry["ratio"]))[:, None], np.zeros((len(entry["ratio"]), 0)),
              np.zeros(len(entry["ratio"]), dtype=np.intp))
        for entry in _facts()["damping"]
    ]  # fmt: skip


def class_spread() -> float:
    """How far classes of reducers differ: the standard deviation of ln stiffness at equal torque.

    The offsets of a line through the catalogues' stiffness against rated torque, one a class.
    """
    rows = [
        (reducer.kind, reducer.rated_torque, own)
        for reducer in all_reducers().values()
        if (own := catalogue_stiffness(reducer)) is not None
    ]
    rows += [("planetary", *row) for row in _facts()["planetary"]["catalogue"]]
    kinds = sorted({row[0] for row in rows})
    design = np.array([[*(float(row[0] == kind) for kind in kinds), math.log(row[1])]
                       for row in rows])  # fmt: skip
    found = np.linalg.lstsq(design, np.log([row[2] for row in rows]), rcond=None)[0]
    return float(np.std(found[:-1], ddof=1))


def catalogue_stiffness(reducer: Reducer) -> float | None:
    """The torsional stiffness, N m/rad, that the maker gives: K2 of a curve; None if there is none.

    Args:
        reducer: of a catalogue.
    """
    if reducer.stiffness is not None or reducer.stiffness_curve is None:
        return reducer.stiffness
    return reducer.stiffness_curve.k2


def to_json(found: Fitted) -> str:
    """The file `fitted.json`.

    Args:
        found: by `refit`.
    """
    plain = json.loads(json.dumps(asdict(found), default=lambda part: part.tolist()))
    text = json.dumps({"facts": facts_hash(), **plain}, separators=(",", ":"))
    return text.replace('],"', '],\n"') + "\n"


def facts_hash() -> str:
    """The SHA-256 of the facts that a fit rests on."""
    return hashlib.sha256((_folder() / "measured.toml").read_bytes()).hexdigest()


@cache
def fitted() -> Fitted:
    """What ships."""
    data = json.loads((_folder() / "fitted.json").read_text(encoding="utf-8"))
    stiffness, effort, damping = (
        Draws(int(data[name].pop("targets")), **{k: _array(v) for k, v in data[name].items()})
        for name in ("stiffness", "effort", "damping")
    )
    return Fitted(stiffness, effort, damping, tuple(data["shares"]),
                  {place: tuple(row) for place, row in data["rings"].items()})  # fmt: skip


def _array(value: Any) -> Array:
    return np.array(value, dtype=float)


def _folder() -> Path:
    return Path(str(files("picchio.robot.drives"))) / "stiffness"


@cache
def _facts() -> dict[str, Any]:
    return tomllib.loads((_folder() / "measured.toml").read_text(encoding="utf-8"))


def _measured(entry: Mapping[str, Any], load: Callable[[str], FlexibleRobot]) -> MeasuredRobot:
    payload = entry.get("payload")
    if "urdf" in entry:
        found = predictors(load(entry["urdf"]), payload)
    else:
        count = entry["joints"]
        known = {**entry, "payload": [payload or math.nan] + [math.nan] * (count - 1)}
        columns = [known.get(name, [math.nan] * count) for name in QUANTITIES]
        found = Predictors(("",) * count, np.log(np.array(columns)).T, places(count))
    stiffness = np.full(len(found.place), np.nan)
    for k, values in enumerate(entry.get("stiffness", ())):
        stiffness[k] = np.log(values).mean() if values else np.nan
    reducer = np.log(entry["reducer_stiffness"]) if "reducer_stiffness" in entry else None
    drives = entry.get("drive_class")
    return MeasuredRobot(
        entry["name"],
        group_of(found, stiffness, CLASSES.index(drives) if drives else None),
        entry.get("evidence", ""),
        entry["source"],
        None if reducer is None else float(np.exp(np.nanmean(stiffness - reducer))),
    )


def _rings(robots: Sequence[MeasuredRobot], place: str) -> tuple[float, float, int]:
    inertia = _TARGETS + QUANTITIES.index("inertia")
    found = []
    for robot in robots:
        first = robot.group.place[:, 0] > 0.0
        rows = first if place == "first" else ~first
        ratio = (robot.truth - robot.group.values[:, inertia])[rows]
        hertz = np.exp(0.5 * ratio[np.isfinite(ratio)]) / (2.0 * np.pi)
        found += [hertz] if len(hertz) else []
    every = np.concatenate(found) if found else np.full(1, np.nan)
    return float(f"{every.min():.3g}"), float(f"{every.max():.3g}"), len(found)


def _rounded(draws: Draws) -> Draws:
    short = np.vectorize(lambda value: float(f"{value:.{_DIGITS}g}"), otypes=[float])
    own = dict(vars(draws))
    return Draws(own.pop("targets"), **{key: short(value) for key, value in own.items()})
