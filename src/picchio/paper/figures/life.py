"""Fig. 11, gravity, shafts, and the life by each correction."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes

from picchio.fatigue.sn.library import load_sn_curve
from picchio.paper.figures.base import PaperFigure, rounded
from picchio.paper.study import Study
from picchio.paper.waterfall import STEEL, Step
from picchio.visuals.plots.style import BLUE, GREEN, GREY, INK, MUTED, ORANGE, VERMILION, look


def figure_11(study: Study) -> PaperFigure:
    """The S-N curve, a shaft steel's, and the curve of Table 2."""
    curve, table = study.printed.sn_curve, study.curve_of_table
    steel = load_sn_curve(STEEL, quiet=True)
    assert steel.ultimate_shear is not None
    n = np.geomspace(1e2, 1e9, 200)
    strength = curve.a * n**curve.b
    at_1000 = curve.a * 1000.0**curve.b
    limit = steel.ultimate_shear / 1e6
    hidden = table.other.values["a"] * n ** table.other.values["b"]

    def draw(ax: Axes) -> None:
        ax.loglog(n, strength, color=BLUE, linewidth=2, label=f"printed: {curve.a:g} N^{curve.b:g}")
        life = np.geomspace(1e3, 1e9, 300)
        ax.loglog(life, steel.amplitude(life) / 1e6, color=GREEN, label=f"{STEEL} (FKM)")
        ax.axhline(limit, color=VERMILION, linestyle=(0, (5, 2)), linewidth=1.1)
        ax.text(1.1e9, limit * 1.06, "shear strength of that steel", color=VERMILION, ha="right",
                fontsize=8)  # fmt: skip
        ax.loglog(n, hidden, color=ORANGE, linestyle=(0, (5, 1.6)), label="through Table 2")
        ax.plot(table.cycles, table.stress, "o", color=ORANGE, markeredgecolor="white",
                markersize=6, label="Table 2: mean stress, N", zorder=4)  # fmt: skip
        ax.plot(1000.0, at_1000, "s", color=BLUE, markersize=6)
        ax.annotate(f"{at_1000:,.0f} MPa", (1000.0, at_1000), xytext=(7, 5),
                    textcoords="offset points", fontsize=8.5, color=BLUE)  # fmt: skip
        ax.set(xlabel="cycles to failure [–]", ylabel="shear stress [MPa]", xlim=(1e2, 1e9))
        ax.legend(loc="lower left", fontsize=8)

    return PaperFigure(
        "fig-11", "Fig. 11: torsional S–N curve of steel",
        f"The printed curve allows {at_1000:,.0f} MPa in shear at 1,000 cycles, where an ordinary "
        f"shaft steel breaks at {limit:,.0f} MPa, and knows no endurance limit. Table 2's points "
        "do not lie on it but, seven of eight, on another line.",
        "S-N curves: the printed one far above Table 2's points, a shaft steel with its limit",
        {"cycles": rounded(n[::10]), "printed": rounded(strength[::10]),
         "steel": rounded(steel.amplitude(n[::10]) / 1e6), "through_table_2": rounded(hidden[::10]),
         "at_1000": at_1000, "steel_breaks_at": limit}, draw, width=7.4, height=3.8, wide=True,
    )  # fmt: skip


def gravity(study: Study) -> tuple[PaperFigure, PaperFigure]:
    """Torque to hold the arm, and the steady stress it makes."""
    angle, torque = study.base.sweep
    largest, limits = torque.max(axis=0), study.printed.arm.actuator_torques
    stress = study.base.gravity_stress.mean(axis=0)
    vibration = study.base.rivet_stress.mean(axis=1)
    printed = study.printed.stress

    def draw(ax: Axes) -> None:
        for j in (1, 2):
            style = look(j)
            ax.plot(np.degrees(angle), torque[:, j], label=f"joint {j + 1}", **style)
            ax.axhline(limits[j], color=style["color"], linewidth=0.9, linestyle=(0, (1, 1.5)))
            ax.text(-88, limits[j] + 8, f"its actuator: {limits[j]:.0f} N m", fontsize=8,
                    color=style["color"])  # fmt: skip
        ax.set(xlabel="joint 2 [°], joint 3 straight", ylabel="torque to hold [N m]")
        ax.legend(loc="upper right")

    def draw_stress(ax: Axes) -> None:
        at = np.arange(3)
        ax.bar(at - 0.27, printed.max(axis=0), 0.25, color=ORANGE, label="Table 2, largest mean")
        ax.bar(at, vibration.max(axis=0), 0.25, color=BLUE, label="vibration, base world")
        ax.bar(at + 0.27, stress, 0.25, color=GREY, label="gravity, base world")
        for x, value in zip(at + 0.27, stress, strict=True):
            ax.annotate(f"{value:.0f}", (x, value), ha="center", va="bottom", fontsize=8.5)
        ax.set_xticks(at, [f"joint {j + 1}" for j in at])
        ax.set(ylabel="shear stress [MPa]")
        ax.legend(loc="upper left")

    times = stress[1] / printed[:, 1].max()
    return (
        PaperFigure(
            "gravity", "Gravity against the stated actuators",
            f"Stretched out, joint 2 must hold {largest[1]:.0f} N m and joint 3 "
            f"{largest[2]:.0f} N m, without tool or payload; the stated actuators give "
            f"{limits[1]:.0f} and {limits[2]:.0f} N m. The arm cannot hold itself up, unless its "
            "gravity is balanced, of which the paper says nothing.",
            "Holding torque of joints 2 and 3 over joint 2's angle, with the actuators' limits",
            {"angle_deg": rounded(np.degrees(angle[::6])), "torque": rounded(torque[::6]),
             "largest": rounded(largest), "actuators": list(limits),
             "share_held": study.base.share_held}, draw, height=3.0,
        ),
        PaperFigure(
            "gravity-stress", "Gravity's steady stress against the vibration",
            f"In the shaft that the springs imply, gravity alone puts {stress[1]:.0f} MPa into "
            f"joint 2, {times:.2g} times the largest mean peak of Table 2. The paper's fatigue "
            "stress leaves it out.",
            "Stress by gravity, by the vibration and of Table 2, joint by joint",
            {"gravity": rounded(stress), "vibration": rounded(vibration),
             "printed": rounded(printed)},
            draw_stress, height=3.0,
        ),
    )  # fmt: skip


def shaft(study: Study) -> PaperFigure:
    """Which shafts have the stated stiffness, and what stress they show."""
    arm = study.printed.arm
    modulus = study.given.shear_modulus
    radius = np.geomspace(5e-3, 60e-3, 120)
    length = {k: modulus * np.pi * radius**4 / (2.0 * k) for k in sorted(set(arm.stiffness))}
    own = [j.shaft for j in study.base.robot.flexible_joints]

    def draw(ax: Axes) -> None:
        for i, (k, values) in enumerate(length.items()):
            ax.loglog(2e3 * radius, 1e3 * values, **look(i), label=f"k = {k:.3g} N m/rad")
        for j in own:
            assert j is not None
            ax.plot(2e3 * j.radius, 1e3 * j.length, "o", color=INK, markersize=5, zorder=4)
        ax.plot([], [], "o", color=INK, markersize=5, label="assumed G r / l")
        x = 2e3 * radius
        for stress in (10e9, 100e9):
            line = 1e3 * modulus * radius / stress
            ax.plot(x, line, color=MUTED, linewidth=0.8, linestyle=(0, (4, 2)))
            ax.annotate(f"{stress / 1e9:.0f} MPa a mrad", (x[0], line[0]), fontsize=7.5,
                        color=MUTED, xytext=(3, 3), textcoords="offset points")  # fmt: skip
        ax.set(xlabel="thickness [mm]", ylabel="length [mm]")
        ax.legend(loc="lower right")

    return PaperFigure(
        "shaft", "Spring against shaft: k = G Jp / l",
        "Every shaft on a line is the whole of a stated spring; which one it is sets the stress "
        "per twist. The paper gives neither r, l nor G, so its stresses hold up to this factor; a "
        "shaft as short as it is thick is a whole drive's spring in name only.",
        "Length over thickness of shafts with the stated stiffness",
        {"thickness_mm": rounded(2e3 * radius[::6]),
         "length_mm": {f"{k:g}": rounded(1e3 * v[::6]) for k, v in length.items()}},
        draw, height=3.2,
    )  # fmt: skip


def corrections(steps: tuple[Step, ...]) -> PaperFigure:
    """The life by the paper's method, by each correction alone, and by all."""
    base = steps[0].rivets
    ends = [s.without_limit if math.isinf(s.rivets) else s.rivets for s in steps]

    def draw(ax: Axes) -> None:
        top = max(ends) * 30
        for k, (step, end) in enumerate(zip(reversed(steps), reversed(ends), strict=True)):
            colour = GREY if step.rivets == base else GREEN if end > base else VERMILION
            if k == len(steps) - 1:
                ax.plot([base, base], [-0.5, k + 0.4], color=INK, linewidth=1)
                ax.plot(base, k, "o", color=INK)
            else:
                ax.barh(k, end - base, left=base, height=0.5, color=colour,
                        alpha=0.35 if math.isinf(step.rivets) else 0.75)  # fmt: skip
            joint = f", joint {step.joint + 1}" if step.joint >= 0 else ""
            if math.isinf(step.rivets):
                words, side, away = f"unlimited ({end:.2g} without the limit){joint}", "right", -8
                arrow = {"arrowstyle": "->", "color": colour, "lw": 1.4}
                ax.annotate("", (end * 8, k), xytext=(end, k), arrowprops=arrow)
            else:
                words, side, away = f"{step.rivets:.3g}{joint}", "left", 8
                if k < len(steps) - 1:
                    words += f"  (× {step.rivets / base:.2g})"
            ax.annotate(words, (max(base, end), k), xytext=(away, 0), ha=side, va="center",
                        textcoords="offset points", fontsize=8.5)  # fmt: skip
        ax.set_xscale("log")
        ax.set_yticks(range(len(steps)), [s.name for s in reversed(steps)])
        ax.set(xlabel="rivets to failure", xlim=(min(ends) / 4, top))
        ax.grid(axis="y", visible=False)

    return PaperFigure(
        "corrections", "The life of the paper's task, by each correction",
        "The base world's task: the paper's method, each correction of it alone, all together. "
        "Pale bars run to where the curve would end without its endurance limit.",
        "Bars from the life by the paper's method to that with each correction",
        {"steps": [s.to_dict() for s in steps]}, draw, width=9.0, height=3.4, wide=True,
    )  # fmt: skip
