"""What the paper prints, and what is tried of it: two data files, read and checked."""

from __future__ import annotations

import functools
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ConfigDict

from picchio.core.arrays import FloatArray
from picchio.core.toml import StrictModel, parse_toml
from picchio.fatigue.sn.curve import SNCurve

FORMAT = "picchio-paper/1"
Triple = tuple[float, float, float]


class PrintedArm(StrictModel):
    """Section 4.1 and Table 1, SI units; inertias are the diagonals of the tensors."""

    page: int
    link_lengths: Triple
    masses: Triple
    centres_of_gravity: tuple[Triple, Triple, Triple]
    inertias: tuple[Triple, Triple, Triple]
    stiffness: Triple
    actuator_torques: Triple
    joint_limits_over_pi: Triple

    @property
    def limits(self) -> FloatArray:
        """(3,) rad, each joint's range is from minus to plus this."""
        return np.pi * np.array(self.joint_limits_over_pi)

    def inertia(self, link: int, about: str) -> FloatArray:
        """(3,) kg m^2, a link's inertia about its centre of gravity.

        Args:
            link: index.
            about: what Table 1's inertias are taken about: "cg", or "joint", whose share m c^2 is
                subtracted.
        """
        found, centre = np.array(self.inertias[link]), np.array(self.centres_of_gravity[link])
        if about == "joint" and link > 0:
            found = found - self.masses[link] * (centre @ centre - centre**2)
        return found


class PrintedTask(StrictModel):
    """What the arm does: blows, rivets, the vertical path of Fig. 9."""

    page: int
    force: float
    hits_per_rivet: int
    rivets: int
    path_heights: tuple[float, float, float, float]
    dominant_joints: tuple[int, int, int, int]


class PrintedCurve(StrictModel):
    """S = a N^b, MPa."""

    page: int
    a: float
    b: float

    def cycles(self, stress: FloatArray) -> FloatArray:
        """(k,) cycles to failure; inf where there is no stress.

        Args:
            stress: (k,) MPa.
        """
        with np.errstate(divide="ignore"):
            return np.asarray((self.a / np.asarray(stress, dtype=float)) ** (-1.0 / self.b))

    @property
    def exponent(self) -> float:
        """M of N ~ S^-m."""
        return -1.0 / self.b

    def sn_curve(self, tensile_strength: float | None = None) -> SNCurve:
        """The same as picchio's own type, Pa.

        Args:
            tensile_strength: Pa, for a mean-stress correction.
        """
        slopes = (self.exponent,)
        return SNCurve(
            name="paper",
            strength=self.a * 1e6,
            cycles=1.0,
            slopes=slopes,
            tensile_strength=tensile_strength,
        )


class PrintedRow(StrictModel):
    """One direction of Table 2: MPa and cycles of the three joints."""

    model_config = ConfigDict(allow_inf_nan=True)

    direction: str
    force_direction: Triple
    stress: Triple
    cycles: Triple


class Remark(StrictModel):
    """Where something stands, and what: in our words, or quoted."""

    page: int
    says: str = ""
    quote: str = ""


class Printed(StrictModel):
    """All that is taken from the paper."""

    title: str
    authors: str
    journal: str
    doi: str
    abstract_page: int
    arm: PrintedArm
    task: PrintedTask
    sn_curve: PrintedCurve
    miner: dict[str, float]
    table2: tuple[PrintedRow, PrintedRow, PrintedRow]
    equations: dict[str, Remark]
    claims: dict[str, Remark]
    slips: tuple[Remark, ...]

    @property
    def stress(self) -> FloatArray:
        """(3 directions, 3 joints) MPa, Table 2."""
        return np.array([row.stress for row in self.table2])

    @property
    def cycles(self) -> FloatArray:
        """(3 directions, 3 joints), Table 2; inf where the stress is zero."""
        return np.array([row.cycles for row in self.table2])

    @property
    def directions(self) -> FloatArray:
        """(3, 3), the force direction of each row of Table 2."""
        return np.array([row.force_direction for row in self.table2])


class Input(StrictModel):
    """An input that the paper does not report: its range or its choices, and what is known of it.

    `called` names it in a condition; `log` samples the range by its logarithm; what is not
    `drawn` is the same in all worlds.
    """

    unit: str = ""
    why: str
    called: str = ""
    low: float | None = None
    high: float | None = None
    choices: tuple[Any, ...] = ()
    log: bool = False
    drawn: bool = True

    def at(self, share: float) -> Any:
        """The value at a share, 0 to 1, of the range, or of the list of choices."""
        if self.low is None or self.high is None:
            return self.choices[min(int(share * len(self.choices)), len(self.choices) - 1)]
        if self.log:
            return float(self.low * (self.high / self.low) ** share)
        return float(self.low + share * (self.high - self.low))

    def range_of(self, name: str) -> str:
        """The range or the choices, in words.

        Args:
            name: of the input.
        """
        tried = ", ".join(map(str, self.choices)) or f"{self.low:.4g} to {self.high:.4g}"
        return f"{name.replace('_', ' ')}: {tried} {self.unit}".rstrip(" –")


class Test(StrictModel):
    """How a claim is tried: the number that decides, between two limits or equal to a third.

    `test` and `decides` are templates; `among` are the inputs that the claim can depend on, all
    if none are named; `worlds` limits in how many it is tried; `condition` is one that the paper
    does not state; `unknown` is a claim that nothing printed can decide.
    """

    figure: str = ""
    test: str
    decides: str
    at_least: float = -np.inf
    at_most: float = np.inf
    equals: str = "{number}"
    among: tuple[str, ...] = ()
    worlds: int | None = None
    condition: str = ""
    unknown: bool = False

    def holds(self, number: float, paper: Printed) -> bool:
        """Whether the number is as the claim wants it."""
        equal = number == float(self.equals.format(number=number, paper=paper))
        return equal and self.at_least <= number <= self.at_most


class Trials(StrictModel):
    """The second file: what is tried of the paper, and how it is shown."""

    inputs: dict[str, Input]
    claims: dict[str, Test]
    conflicts: dict[str, dict[str, str]]
    equations: dict[str, dict[str, str]]
    figures: dict[str, dict[str, Any]]
    legends: dict[str, str]


def paper_file(name: str = "paper.toml") -> Path:
    """A data file; the first is what the paper prints."""
    return Path(str(files("picchio.paper") / "data" / name))


@functools.cache
def printed() -> Printed:
    """What the paper prints."""
    return parse_toml(paper_file(), Printed, format=FORMAT)


@functools.cache
def trials() -> Trials:
    """What is tried of it."""
    return parse_toml(paper_file("trials.toml"), Trials, format=FORMAT)
