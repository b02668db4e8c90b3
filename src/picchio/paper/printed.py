"""What the paper prints: one data file, each value with its page."""

from __future__ import annotations

import functools
from importlib.resources import files
from pathlib import Path

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
        """Life at stresses in MPa; inf at none.

        Args:
            stress: (k,) MPa.

        Returns:
            (k,) cycles to failure.
        """
        with np.errstate(divide="ignore"):
            return np.asarray((self.a / np.asarray(stress, dtype=float)) ** (-1.0 / self.b))

    @property
    def exponent(self) -> float:
        """M of N ~ S^-m."""
        return -1.0 / self.b

    def sn_curve(self, tensile_strength: float | None = None) -> SNCurve:
        """The same as picchio's own type; Pa.

        Args:
            tensile_strength: Pa, for a mean-stress correction.
        """
        return SNCurve(
            name="paper",
            strength=self.a * 1e6,
            cycles=1.0,
            slopes=(self.exponent,),
            tensile_strength=tensile_strength,
        )


class PrintedMiner(StrictModel):
    """Eq. 18's constant: its range, and the value used."""

    page: int
    least: float
    most: float
    used: float


class PrintedRow(StrictModel):
    """One direction of Table 2: MPa and cycles of the three joints."""

    model_config = ConfigDict(allow_inf_nan=True)

    direction: str
    force_direction: Triple
    stress: Triple
    cycles: Triple


class Sentence(StrictModel):
    """A claim in the paper's words."""

    page: int
    quote: str


class Remark(StrictModel):
    """Where something stands, and what."""

    page: int
    says: str


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
    miner: PrintedMiner
    table2: tuple[PrintedRow, PrintedRow, PrintedRow]
    equations: dict[str, Remark]
    claims: dict[str, Sentence]
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


def paper_file() -> Path:
    """The data file."""
    return Path(str(files("picchio.paper") / "data" / "paper.toml"))


@functools.cache
def printed() -> Printed:
    """What the paper prints."""
    return parse_toml(paper_file(), Printed, format=FORMAT)
