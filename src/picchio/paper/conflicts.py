"""Contradictions in the paper: each with the number that decides and the figure that shows it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from picchio.paper.figures.base import PaperFigure
from picchio.paper.study import Study
from picchio.paper.verdict import plainly


@dataclass(frozen=True)
class Conflict:
    """Two statements of the paper that cannot both be true.

    Attributes:
        name: unique.
        says: what the paper says, with its pages.
        but: what follows from its own numbers.
        number: that decides.
        figure: name of the figure that shows it.
    """

    name: str
    says: str
    but: str
    number: float
    figure: str

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__}


Finder = Callable[[Study, dict[str, PaperFigure]], Conflict]
CONFLICTS: list[Finder] = []


def conflict(finder: Finder) -> Finder:
    """Register one."""
    CONFLICTS.append(finder)
    return finder


def conflicts(study: Study, figures: dict[str, PaperFigure]) -> tuple[Conflict, ...]:
    """All of them."""
    return tuple(finder(study, figures) for finder in CONFLICTS)


@conflict
def _actuators(study: Study, figures: dict[str, PaperFigure]) -> Conflict:
    data = figures["gravity"].data
    need, have = data["largest"][1], data["actuators"][1]
    return Conflict(
        "actuators",
        f"Joint 2's actuator gives {have:.0f} N m at most (p. 297).",
        f"To hold the arm of Table 1 stretched out takes {need:.0f} N m, {need / have:.2g} times "
        "that, before any tool or payload.",
        need, "gravity",
    )  # fmt: skip


@conflict
def _mean_stress(study: Study, figures: dict[str, PaperFigure]) -> Conflict:
    data = figures["gravity-stress"].data
    steady, largest = data["gravity"][1], float(np.max(study.printed.stress[:, 1]))
    return Conflict(
        "mean-stress",
        f"Joint 2's fatigue stress is {largest:g} MPa at most (Table 2).",
        f"Gravity puts {steady:.0f} MPa into the same shaft, {steady / largest:.2g} times as much, "
        "as a steady stress that the life does not know.",
        steady, "gravity-stress",
    )  # fmt: skip


@conflict
def _range(study: Study, figures: dict[str, PaperFigure]) -> Conflict:
    data = figures["range"].data
    return Conflict(
        "range",
        f"Joint 3 turns ± {data['limit_deg']:.0f}° (p. 297); Fig. 9's tool goes from z = "
        f"{study.printed.task.path_heights[0]:g} to {study.printed.task.path_heights[-1]:g} m at "
        "the same x.",
        f"No x allows that. The best, {data['at_x']:.2f} m, needs {data['least_bend_deg']:.0f}°.",
        data["least_bend_deg"], "range",
    )  # fmt: skip


@conflict
def _rings(study: Study, figures: dict[str, PaperFigure]) -> Conflict:
    return Conflict(
        "rings",
        "Joint 2's largest deflection over all directions is at the up and low end (p. 299, "
        "Fig. 10b).",
        "Worst-direction maps of joints 2 and 3 are rings about joint 2: turning it changes the "
        f"peak by {figures['rings'].data['spread']:.1g} of itself, so up, down and out are alike.",
        figures["rings"].data["spread"], "rings",
    )  # fmt: skip


@conflict
def _x_force(study: Study, figures: dict[str, PaperFigure]) -> Conflict:
    data = figures["x-force"].data["joint_1"]
    return Conflict(
        "x-force",
        "At full reach along x, forces along x make the largest torque on joint 1 (p. 299).",
        f"They point at its axis: {plainly(max(data['x']))} mrad. Forces along y make up to "
        f"{max(data['y']):.2g} mrad.",
        max(data["x"]), "x-force",
    )  # fmt: skip


@conflict
def _z_force(study: Study, figures: dict[str, PaperFigure]) -> Conflict:
    data = figures["z-force"].data["joint_2"]
    return Conflict(
        "z-force",
        "At full reach along z, forces along z make the largest torque on joint 2 (p. 299).",
        f"They pass through its axis: {plainly(data['z'][-1])} mrad. Forces along x make "
        f"{data['x'][-1]:.2g} mrad there. In both sentences the axes may be exchanged; with x the "
        "second comes right for joint 2, the first stays wrong for joint 1.",
        data["z"][-1], "z-force",
    )  # fmt: skip


@conflict
def _steady(study: Study, figures: dict[str, PaperFigure]) -> Conflict:
    data = figures["steady-state"].data
    rivet = study.printed.task.hits_per_rivet * study.given.period
    return Conflict(
        "steady-state",
        f"The transient dies out and the steady state counts (p. 295); a rivet takes "
        f"{study.printed.task.hits_per_rivet} hits (p. 300).",
        f"The slowest mode fades with {data['time_constant']:.2g} s, a rivet lasts {rivet:.2g} s: "
        f"the real peak is {data['ratio']:.3g} times the steady one.",
        data["ratio"], "steady-state",
    )  # fmt: skip


@conflict
def _curve(study: Study, figures: dict[str, PaperFigure]) -> Conflict:
    return Conflict(
        "curve",
        "The S–N curve is of steel like that of common joint shafts (p. 299).",
        f"It allows {figures['fig-11'].data['at_1000']:,.0f} MPa in shear at 1,000 cycles; an "
        "ordinary quenched and tempered shaft steel breaks at "
        f"{figures['fig-11'].data['steel_breaks_at']:,.0f} MPa at once.",
        figures["fig-11"].data["at_1000"], "fig-11",
    )  # fmt: skip


@conflict
def _table(study: Study, figures: dict[str, PaperFigure]) -> Conflict:
    table = study.curve_of_table
    return Conflict(
        "table-2",
        "Table 2's N follow from its mean stresses by the S–N curve (pp. 299–300).",
        f"By that curve they would be {table.over_printed.min():.3g} to "
        f"{table.over_printed.max():.3g} times as long. They follow from the means by another.",
        float(table.over_printed.max()), "table-2-lives",
    )  # fmt: skip


@conflict
def _shaft(study: Study, figures: dict[str, PaperFigure]) -> Conflict:
    shaft = study.base.robot.flexible_joints[1].shaft
    assert shaft is not None
    return Conflict(
        "shaft",
        "Joint stiffness k is given (p. 297), stress comes from G r Δq / l (eq. 17): k and G r / l "
        "both describe the same shaft.",
        f"With the assumed G r / l the shaft is {2e3 * shaft.radius:.0f} mm thick and "
        f"{1e3 * shaft.length:.0f} mm long: {shaft.length / (2 * shaft.radius):.2g} times as long "
        f"as thick, in the joint of an arm of {sum(study.printed.arm.link_lengths[1:]):g} m. A "
        "drive yields in its gears too, and then eq. 17 overstates the stress.",
        shaft.length / (2.0 * shaft.radius), "shaft",
    )  # fmt: skip


@conflict
def _sequence(study: Study, figures: dict[str, PaperFigure]) -> Conflict:
    data = figures["dominance"].data
    share = data["agree"][4] / data["tried"]
    wanted, stiffness = study.printed.task.dominant_joints, study.printed.arm.stiffness
    return Conflict(
        "sequence",
        f"Going down, the dominant joint is {', '.join(map(str, wanted))} (p. 297).",
        f"Joint 1's spring is {stiffness[0] / stiffness[1]:.2g} times as stiff as the others, so "
        f"it leads only where the blows meet its mode: {100 * share:.2g} % of the worlds that the "
        "paper leaves open do all four.",
        share, "dominance",
    )  # fmt: skip


@conflict
def _phase(study: Study, figures: dict[str, PaperFigure]) -> Conflict:
    data = figures["phase"].data
    exact, plain = np.array(data["exact"]), np.array(data["plain"])
    off = float(np.abs(plain - exact).max() / np.abs(exact).max())
    return Conflict(
        "phase",
        "The phase of eq. 13 is a sum of two tan⁻¹ (p. 295).",
        f"Above resonance their quadrant is wrong; so taken, the history errs by {100 * off:.2g} % "
        "of its peak. It is a slip of writing if the authors computed with atan2.",
        off, "phase",
    )  # fmt: skip
