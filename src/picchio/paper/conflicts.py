"""Contradictions in the paper: each with the number that decides and the figure that shows it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

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


def conflicts(study: Study, figures: Mapping[str, PaperFigure]) -> Iterator[Conflict]:
    """All of them, by the numbers of the figures that show them."""
    shown = {name: figure.data for name, figure in figures.items()}
    # Gravity.
    need, have = shown["gravity"]["largest"][1], shown["gravity"]["actuators"][1]
    yield Conflict(
        "actuators",
        f"Joint 2's actuator gives {have:.0f} N m at most (p. 297).",
        f"To hold the arm of Table 1 stretched out takes {need:.0f} N m, {need / have:.2g} times "
        "that, before any tool or payload.",
        need, "gravity",
    )  # fmt: skip
    steady, largest = shown["gravity-stress"]["gravity"][1], float(study.printed.stress[:, 1].max())
    yield Conflict(
        "mean-stress",
        f"Joint 2's fatigue stress is {largest:g} MPa at most (Table 2).",
        f"Gravity puts {steady:.0f} MPa into the same shaft, {steady / largest:.2g} times as much, "
        "as a steady stress that the life does not know.",
        steady, "gravity-stress",
    )  # fmt: skip
    # Reach.
    path, heights = shown["range"], study.printed.task.path_heights
    yield Conflict(
        "range",
        f"Joint 3 turns ± {path['limit_deg']:.0f}° (p. 297); Fig. 9's tool goes from z = "
        f"{heights[0]:g} to {heights[-1]:g} m at the same x.",
        f"No x allows that. The best, {path['at_x']:.2f} m, needs {path['least_bend_deg']:.0f}°.",
        path["least_bend_deg"], "range",
    )  # fmt: skip
    spread = shown["rings"]["spread"]
    yield Conflict(
        "rings",
        "Joint 2's largest deflection over all directions is at the up and low end (p. 299, "
        "Fig. 10b).",
        "Worst-direction maps of joints 2 and 3 are rings about joint 2: turning it changes the "
        f"peak by {spread:.1g} of itself, so up, down and out are alike.",
        spread, "rings",
    )  # fmt: skip
    by_x = shown["x-force"]["joint_1"]
    yield Conflict(
        "x-force",
        "At full reach along x, forces along x make the largest torque on joint 1 (p. 299).",
        f"They point at its axis: {plainly(max(by_x['x']))} mrad. Forces along y make up to "
        f"{max(by_x['y']):.2g} mrad.",
        max(by_x["x"]), "x-force",
    )  # fmt: skip
    by_z = shown["z-force"]["joint_2"]
    yield Conflict(
        "z-force",
        "At full reach along z, forces along z make the largest torque on joint 2 (p. 299).",
        f"They pass through its axis: {plainly(by_z['z'][-1])} mrad. Forces along x make "
        f"{by_z['x'][-1]:.2g} mrad there. In both sentences the axes may be exchanged; with x the "
        "second comes right for joint 2, the first stays wrong for joint 1.",
        by_z["z"][-1], "z-force",
    )  # fmt: skip
    # Life.
    blows, hits = shown["steady-state"], study.printed.task.hits_per_rivet
    yield Conflict(
        "steady-state",
        f"The transient dies out and the steady state counts (p. 295); a rivet takes "
        f"{hits} hits (p. 300).",
        f"The slowest mode fades with {blows['time_constant']:.2g} s, a rivet lasts "
        f"{hits * study.given.period:.2g} s: the real peak is {blows['ratio']:.3g} times the "
        "steady one.",
        blows["ratio"], "steady-state",
    )  # fmt: skip
    curve = shown["fig-11"]
    yield Conflict(
        "curve",
        "The S–N curve is of steel like that of common joint shafts (p. 299).",
        f"It allows {curve['at_1000']:,.0f} MPa in shear at 1,000 cycles; an ordinary quenched "
        f"and tempered shaft steel breaks at {curve['steel_breaks_at']:,.0f} MPa at once.",
        curve["at_1000"], "fig-11",
    )  # fmt: skip
    longer = study.curve_of_table.over_printed
    yield Conflict(
        "table-2",
        "Table 2's N follow from its mean stresses by the S–N curve (pp. 299–300).",
        f"By that curve they would be {longer.min():.3g} to {longer.max():.3g} times as long. "
        "They follow from the means by another.",
        float(longer.max()), "table-2-lives",
    )  # fmt: skip
    # Joints.
    shaft = study.base.robot.flexible_joints[1].shaft
    assert shaft is not None
    slender = shaft.length / (2.0 * shaft.radius)
    yield Conflict(
        "shaft",
        "Joint stiffness k is given (p. 297), stress comes from G r Δq / l (eq. 17): k and G r / l "
        "both describe the same shaft.",
        f"With the assumed G r / l the shaft is {2e3 * shaft.radius:.0f} mm thick and "
        f"{1e3 * shaft.length:.0f} mm long: {slender:.2g} times as long as thick, in the joint of "
        f"an arm of {sum(study.printed.arm.link_lengths[1:]):g} m. A drive yields in its gears "
        "too, and then eq. 17 overstates the stress.",
        slender, "shaft",
    )  # fmt: skip
    share = shown["dominance"]["agree"][4] / shown["dominance"]["tried"]
    wanted, stiffness = study.printed.task.dominant_joints, study.printed.arm.stiffness
    yield Conflict(
        "sequence",
        f"Going down, the dominant joint is {', '.join(map(str, wanted))} (p. 297).",
        f"Joint 1's spring is {stiffness[0] / stiffness[1]:.2g} times as stiff as the others, so "
        f"it leads only where the blows meet its mode: {100 * share:.2g} % of the worlds that the "
        "paper leaves open do all four.",
        share, "dominance",
    )  # fmt: skip
    exact, plain = (np.array(shown["phase"][key]) for key in ("exact", "plain"))
    off = float(np.abs(plain - exact).max() / np.abs(exact).max())
    yield Conflict(
        "phase",
        "The phase of eq. 13 is a sum of two tan⁻¹ (p. 295).",
        f"Above resonance their quadrant is wrong; so taken, the history errs by {100 * off:.2g} % "
        "of its peak. It is a slip of writing if the authors computed with atan2.",
        off, "phase",
    )  # fmt: skip
