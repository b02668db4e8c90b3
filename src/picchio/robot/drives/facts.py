"""The stiffness of joints that was measured, and what was fitted to it.

`stiffness/measured.toml` holds the facts with their sources, `stiffness/fitted.json` what
`benchmarks/drive_priors.py --refit` makes of them: draws of `picchio.robot.drives.hierarchy`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from picchio.robot.drives.hierarchy import Draws, Group
from picchio.robot.drives.predictors import (
    OF_EFFORT,
    OF_STIFFNESS,
    QUANTITIES,
    Predictors,
)
from picchio.robot.drives.reducer import Reducer

Array = NDArray[np.float64]

TARGETS = 2  # columns of stiffness, an arm's and a wrist's
CLASSES = ("strain-wave", "cycloidal", "planetary")
"""Of drives, as far as the data have them."""


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
    columns = np.full((len(asked), TARGETS), np.nan)
    if stiffness is not None:
        columns[np.arange(len(asked)), asked] = stiffness
    return Group(np.hstack([columns, found.values]), found.place, asked, kind)


def stiffness_beside(group: Group, names: Sequence[str] = OF_STIFFNESS) -> Group:
    """A robot's table with the predictors of its stiffness alone.

    Args:
        group: of `group_of`.
        names: of the predictors.
    """
    columns = [0, 1, *(TARGETS + QUANTITIES.index(name) for name in names)]
    return replace(group, values=group.values[:, columns])


def effort_beside(group: Group) -> Group:
    """A robot's table with its effort limits as what is asked for, beside their predictors.

    Args:
        group: of `group_of`.
    """
    columns = [TARGETS + QUANTITIES.index(name) for name in ("effort", *OF_EFFORT)]
    nothing = np.zeros_like(group.asked)
    return Group(group.values[:, columns], group.place, nothing)


def catalogue_stiffness(reducer: Reducer) -> float | None:
    """The torsional stiffness, N m/rad, that the maker gives: K2 of a curve; None if there is none.

    Args:
        reducer: of a catalogue.
    """
    if reducer.stiffness is not None or reducer.stiffness_curve is None:
        return reducer.stiffness
    return reducer.stiffness_curve.k2


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
