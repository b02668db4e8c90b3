"""Inputs that the paper does not report and a reproduction must assume: their ranges, and why."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from picchio.core.errors import InputError


@dataclass(frozen=True)
class Input:
    """One unreported input.

    Attributes:
        name: the field of `Assumptions`.
        unit: as shown.
        why: what is known of it.
        low: the least value that is tried; None for a choice.
        high: the largest.
        choices: the values of a choice.
        log: whether the range is sampled by its logarithm.
    """

    name: str
    unit: str
    why: str
    low: float | None = None
    high: float | None = None
    choices: tuple[Any, ...] = ()
    log: bool = False

    def at(self, share: float) -> Any:
        """The value at a share of the range, or of the list of choices.

        Args:
            share: 0 to 1.
        """
        if self.low is None or self.high is None:
            return self.choices[min(int(share * len(self.choices)), len(self.choices) - 1)]
        if self.log:
            return float(self.low * (self.high / self.low) ** share)
        return float(self.low + share * (self.high - self.low))


@dataclass(frozen=True)
class Assumptions:
    """A value for every input that the paper leaves open; the defaults are the base world.

    SI units; `stress_per_twist` is G r / l, the stress in the shaft by the joint's deflection.
    """

    period: float = 0.040
    duty: float = 0.10
    damping_ratio: float = 0.03
    harmonics: int = 30
    stress_per_twist: float = 27.77e9
    shear_modulus: float = 79.3e9
    inertia_about: str = "cg"
    path_x: float = 0.9
    elbow: str = "down"
    rows: int = 3
    columns: int = 5
    pitch: float = 0.25
    panel_x: float = 1.35
    panel_y: float = 0.0
    panel_z: float = 0.65

    @property
    def width(self) -> float:
        """T_d, s."""
        return self.duty * self.period

    def but(self, **changes: Any) -> Assumptions:
        """The same with some values changed.

        Args:
            changes: attribute = value.
        """
        return dataclasses.replace(self, **changes)


INPUTS: tuple[Input, ...] = (
    Input("period", "s", "T of eq. 12 is not given; rivet guns strike 7 to 50 times a second",
          0.02, 0.15, log=True),
    Input("duty", "–", "T_d / T of eq. 12 is not given", 0.03, 0.5, log=True),
    Input("damping_ratio", "–", "ς of eq. 11 is not given; measured arms have 0.5 to 8 %",
          0.005, 0.08, log=True),
    Input("harmonics", "–", "N of eq. 12 is not given; the exact solution needs none", 3, 300,
          log=True),
    Input("stress_per_twist", "Pa", "G r / l of eqs. 16 and 17 is not given; with k = G Jp / l it "
          "fixes the shaft", 10e9, 80e9, log=True),
    Input("shear_modulus", "Pa", "G of eq. 17 is not given; steel", 75e9, 83e9),
    Input("inertia_about", "", "Table 1 does not say about which point its inertias are",
          choices=("cg", "joint")),
    Input("path_x", "m", "the x of Fig. 9's vertical path is not given; at most 1.16 m is in reach",
          0.3, 1.16),
    Input("elbow", "", "which of two poses reaches a rivet is not told", choices=("down", "up")),
    Input("rows", "–", "Fig. 12 is not in the text; 15 rivets", choices=(3, 5, 1)),
    Input("columns", "–", "as rows", choices=(5, 3, 15)),
    Input("pitch", "m", "the distance between rivets is not given", 0.03, 0.25, log=True),
    Input("panel_x", "m", "the pattern's place is not given", 0.4, 1.35),
    Input("panel_y", "m", "as panel_x", 0.0, 0.8),
    Input("panel_z", "m", "as panel_x", 0.4, 1.4),
)  # fmt: skip


def parse_assumptions(given: Iterable[str]) -> Assumptions:
    """The base world's assumptions, changed by words such as "period=0.1".

    Raises:
        InputError: an unknown name, or a bad value.
    """
    values: dict[str, Any] = {}
    fields = {f.name: f for f in dataclasses.fields(Assumptions)}
    choices = {i.name: i.choices for i in INPUTS if i.choices and isinstance(i.choices[0], str)}
    for word in given:
        name, equals, text = word.partition("=")
        if name not in fields:
            raise InputError("unknown assumption", key="--assume", value=name, choices=fields)
        if not equals:
            raise InputError("must be NAME=VALUE", key="--assume", value=word)
        if name in choices:
            if text not in choices[name]:
                raise InputError("unknown", key=f"--assume {name}", value=text,
                                 choices=choices[name])  # fmt: skip
            values[name] = text
            continue
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        whole = name in ("harmonics", "rows", "columns")
        positive = name not in ("panel_x", "panel_y", "panel_z", "path_x")
        if not math.isfinite(number) or (positive and number <= 0.0):
            raise InputError("must be a finite number, and positive where it is a size",
                             key=f"--assume {name}", value=text)  # fmt: skip
        if whole and number != int(number):
            raise InputError("must be a whole number", key=f"--assume {name}", value=text)
        values[name] = int(number) if whole else number
    if values.get("duty", 0.5) >= 1.0:
        raise InputError("must be below 1", key="--assume duty", value=values["duty"])
    return Assumptions(**values)
