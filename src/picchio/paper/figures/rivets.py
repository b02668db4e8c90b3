"""Figs. 12 to 15: the rivets, and the stresses over them."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from picchio.paper.arm import rivet_points
from picchio.paper.figures.base import PaperFigure, rounded
from picchio.paper.influence import influences
from picchio.paper.study import Study
from picchio.visuals.plots.style import BLUE, INK, MUTED, look


def figure_12(study: Study) -> PaperFigure:
    """The rivet pattern and its path."""
    given = study.given
    points = rivet_points(given)

    def draw(ax: Axes) -> None:
        ax.plot(points[:, 1], points[:, 2], color=BLUE, linewidth=1)
        ax.plot(points[:, 1], points[:, 2], "o", color=BLUE, markersize=6)
        for k, (_, y, z) in enumerate(points):
            ax.annotate(str(k + 1), (y, z), xytext=(4, 4), textcoords="offset points", fontsize=8)
        ax.set_aspect("equal")
        ax.set(xlabel="y [m]", ylabel="z [m]")
        ax.margins(0.12)

    return PaperFigure(
        "fig-12", "Fig. 12: rivet pattern and path",
        f"Assumed: {given.rows} rows of {given.columns}, {given.pitch:g} m apart, on a panel at "
        f"x = {given.panel_x:g} m that faces the robot; the numbers are the sequence.",
        f"{len(points)} rivets in {given.rows} rows with the path that joins them",
        {"points": rounded(points)}, draw, width=4.6, height=3.0,
    )  # fmt: skip


def figures_13_to_15(study: Study) -> PaperFigure:
    """Peak stresses over the rivets, in the base world and in the fitted one."""
    worlds = {"base": study.base, "fitted": study.fitted}
    rows = study.printed.table2
    means = {name: world.rivet_stress.mean(axis=1) for name, world in worlds.items()}

    def draw(axes: Any) -> None:
        for r, (name, world) in enumerate(worlds.items()):
            top = 1.12 * max(float(world.rivet_stress.max()), float(study.printed.stress.max()))
            for d, row in enumerate(rows):
                ax = axes[r, d]
                for j in range(3):
                    style = look(j)
                    ax.plot(np.arange(1, 1 + world.rivet_stress.shape[1]),
                            world.rivet_stress[d, :, j], marker="o", markersize=3, **style,
                            label=f"joint {j + 1}")  # fmt: skip
                    ax.axhline(row.stress[j], color=style["color"], linewidth=0.8, alpha=0.55,
                               linestyle=(0, (1, 1.5)))  # fmt: skip
                ax.set_ylim(0.0, top)
                ax.set_title(f"{row.direction}, {name} world")
                if r:
                    ax.set_xlabel("rivet")
            axes[r, 0].set_ylabel("peak stress [MPa]")
        axes[0, 0].legend(loc="upper left", fontsize=7.5, ncols=3, handlelength=1.6)

    return PaperFigure(
        "fig-13-15", "Figs. 13–15: peak stresses over 15 rivets, forward, left, upward",
        "Dotted: Table 2's printed means. Above, the base world; below, the world that comes "
        "nearest to them. They are not the paper's curves, which the text does not hold.",
        "Six panels: peak stress of three joints over the rivets in three directions, two worlds",
        {name: {"stress": rounded(world.rivet_stress, 5), "mean": rounded(means[name])}
         for name, world in worlds.items()},
        draw, columns=3, rows=2, width=10.6, height=5.4, sharex=True, wide=True,
    )  # fmt: skip


def influence(study: Study) -> PaperFigure:
    """One input at a time from its least to its largest value: the effect on the life."""
    rows = influences(study)
    base = rows[0].lives[0]

    def draw(ax: Axes) -> None:
        for k, row in enumerate(reversed(rows)):
            low, high = min(row.lives), max(row.lives)
            ax.barh(
                k, np.log10(high / low), left=np.log10(low), height=0.55, color=BLUE, alpha=0.55
            )
            if high / low < 1.0001:
                ax.plot(np.log10(low), k, "|", color=BLUE, markersize=12)
        ax.axvline(np.log10(base), color=INK, linewidth=1)
        ax.set_yticks(range(len(rows)), [row.words for row in reversed(rows)])
        every = np.log10([life for row in rows for life in row.lives])
        low, high = float(every.min()) - 0.2, float(every.max()) + 0.2
        ax.set_xlim(low, high)
        ticks = np.arange(np.ceil(low), np.floor(high) + 1)
        ax.set_xticks(ticks, [f"$10^{{{int(t)}}}$" for t in ticks])
        ax.set(xlabel="rivets to failure by the paper's method")
        ax.grid(axis="y", visible=False)
        ax.tick_params(axis="y", labelcolor=INK, color=MUTED)

    return PaperFigure(
        "influence", "What each unreported input does to the life",
        "The life of the paper's task by its own method as one input goes from its least to its "
        "largest value (or through its choices), the others as in the base world (line).",
        "Bars of the life's range for each unreported input, widest first",
        {row.name: row.to_dict() for row in rows},
        draw, width=7.6, height=0.6 + 0.34 * len(rows), wide=True,
    )  # fmt: skip
