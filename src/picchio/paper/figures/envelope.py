"""Fig. 9: the envelopes on the vertical path, and how rare the paper's sequence is."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from picchio.core.arrays import FloatArray
from picchio.paper.arm import poses_at
from picchio.paper.claims.envelope import lean, waist
from picchio.paper.dominance import search_dominance
from picchio.paper.figures.base import PaperFigure, rounded
from picchio.paper.study import Study
from picchio.paper.world import World
from picchio.visuals.plots.style import BLUE, COLOURS, GREY, INK, MUTED, VERMILION, look


def figure_9(study: Study) -> PaperFigure:
    """Envelopes at the four heights."""
    return envelopes(
        study.base, "fig-9", "Fig. 9: envelopes in four configurations",
        "Cuts through the envelopes, over all force directions: joints 2 and 3 in the arm's plane, "
        "joint 1 (whose envelope lies across it) seen from above. Lines: the worst directions. "
        "The largest of each pose is named; the x of the path is assumed.",
    )  # fmt: skip


def envelopes(world: World, name: str, title: str, caption: str) -> PaperFigure:
    """The four poses of the vertical path, with their envelopes."""
    angle = np.linspace(0.0, np.pi, 60, endpoint=False)
    radii = 1e3 * world.path_radii(angle)
    radii[:, :, 0] = 1e3 * world.path_radii(angle, towards=(0.0, 1.0, 0.0))[:, :, 0]
    peaks = 1e3 * world.path_peaks.peak_deflection
    heights = world.printed.task.path_heights
    wanted = world.printed.task.dominant_joints

    def draw(axes: Any) -> None:
        largest = peaks.max()
        for k, ax in enumerate(axes):
            _arm(ax, world, k)
            tip = np.array([world.given.path_x, heights[k]])
            turn = np.concatenate([angle, angle + np.pi, [2.0 * np.pi]])
            for j in (0, 1, 2):
                row = np.concatenate([radii[:, k, j], radii[:, k, j], radii[:1, k, j]])
                r = 0.42 * row / largest
                style = look(j)
                ax.plot(tip[0] + r * np.cos(turn), tip[1] + r * np.sin(turn), **style,
                        label=f"joint {j + 1}", linewidth=1.4)  # fmt: skip
                ax.fill(tip[0] + r * np.cos(turn), tip[1] + r * np.sin(turn),
                        color=style["color"], alpha=0.12)  # fmt: skip
                n = world.path_peaks.direction[k, j][[0, 1] if j == 0 else [0, 2]]
                reach = 0.42 * peaks[k, j] / largest
                ax.plot(*np.stack([tip - reach * n, tip + reach * n]).T, color=style["color"],
                        linewidth=0.9)  # fmt: skip
            ax.set_aspect("equal")
            ax.set(xlim=(-0.25, 1.75), ylim=(-0.1, 2.0), xlabel="x [m]")
            best = int(peaks[k].argmax()) + 1
            ax.set_title(f"z = {heights[k]:g} m: joint {best}\n(paper: joint {wanted[k]})")
            if k:
                ax.set_yticklabels([])
        axes[0].set_ylabel("z [m]")
        axes[0].legend(loc="upper left", fontsize=7.5, handlelength=1.6)

    leads = ", ".join(f"joint {int(row.argmax()) + 1}" for row in peaks)
    return PaperFigure(
        name, title, caption,
        f"Direction envelopes of the three joints at four heights; the largest is {leads}",
        {"height": list(heights), "peak_mrad": rounded(peaks), "lean_deg": rounded(lean(world)),
         "waist": rounded(waist(world)),
         "worst_direction": rounded(world.path_peaks.direction)},
        draw, columns=4, width=11.5, height=3.9, wide=True,
    )  # fmt: skip


def _arm(ax: Axes, world: World, k: int) -> None:
    q2 = world.path_poses[k, 1]
    l1, l2, _ = world.printed.arm.link_lengths
    elbow = np.array([l2 * np.cos(q2), l1 + l2 * np.sin(q2)])
    tip = np.array([world.given.path_x, world.printed.task.path_heights[k]])
    ax.plot([0, 0, elbow[0], tip[0]], [0, l1, elbow[1], tip[1]], color=GREY, linewidth=5,
            solid_joinstyle="round", alpha=0.5, zorder=1)  # fmt: skip
    ax.plot([0, elbow[0]], [l1, elbow[1]], "o", color=MUTED, markersize=4, zorder=2)


def dominance(study: Study) -> tuple[PaperFigure, ...]:
    """Where the sequence is found, and the clearest world that has it."""
    found = search_dominance(study)
    wanted = ", ".join(str(j) for j in study.printed.task.dominant_joints)
    values, agree = found.values, found.agree

    def draw(axes: Any) -> None:
        counts = np.array([(agree == k).sum() for k in range(5)])
        axes[0].bar(range(5), 100 * counts / counts.sum(), color=[GREY] * 4 + [VERMILION])
        for k, count in enumerate(counts):
            axes[0].annotate(f"{100 * count / counts.sum():.2g} %", (k, 100 * count / counts.sum()),
                             ha="center", va="bottom", fontsize=8.5)  # fmt: skip
        axes[0].set(xlabel="heights at which the joint agrees", ylabel="worlds [%]",
                    title="How many of four agree")  # fmt: skip
        _scatter(axes[1], values, agree)

    made = [PaperFigure(
        "dominance", f"How rare the sequence {wanted} is",
        f"{found.tried} worlds with T, Td/T, damping, x, elbow and the inertias' point drawn from "
        f"their ranges; {found.hits} have the paper's sequence. It takes a mode of joint 1 that "
        "a harmonic of the blows meets just as the arm comes down.",
        f"Bars: share of worlds by agreeing heights; {found.hits} of {found.tried} agree at four",
        {"tried": found.tried, "hits": found.hits,
         "agree": [int((agree == k).sum()) for k in range(5)]},
        draw, columns=2, width=8.4, height=3.3, wide=True,
    )]  # fmt: skip
    if found.example is not None:
        made.append(envelopes(
            found.example, "fig-9-found", "Fig. 9 in a world that has the paper's sequence",
            "The clearest of the worlds found: "
            + found.words.removeprefix("several inputs match, for instance ") + ".",
        ))  # fmt: skip
    return tuple(made)


def _scatter(ax: Axes, values: FloatArray, agree: FloatArray) -> None:
    some = values[::8]  # enough to see where was looked
    ax.plot(1e3 * some[:, 0], some[:, 3], ".", color=GREY, markersize=2.5, alpha=0.6)
    full = agree == 4
    ax.plot(1e3 * values[full, 0], values[full, 3], "o", color=VERMILION, markersize=4.5,
            markeredgecolor="white", markeredgewidth=0.5)  # fmt: skip
    ax.set_xscale("log")
    ax.set_xticks([20, 30, 50, 80, 150], ["20", "30", "50", "80", "150"])
    ax.set_xticks([], minor=True)
    ax.set(xlabel="period T [ms]", ylabel="x of the path [m]", title="Where all four agree")


def reach_of_path(study: Study) -> PaperFigure:
    """Joint 3's stated range against the vertical path."""
    world = study.base
    limit = float(world.printed.arm.limits[2])
    x = np.linspace(0.2, 1.6, 400)
    points = [[(at, 0.0, z) for at in x] for z in world.printed.task.path_heights]
    bend = np.abs(poses_at(points)[..., 2])
    worst = bend.max(axis=0)
    least = float(np.degrees(np.nanmin(worst)))
    at = float(x[int(np.nanargmin(worst))])
    l1, l2, l3 = world.printed.arm.link_lengths
    inner = float(np.sqrt(l2**2 + l3**2 + 2.0 * l2 * l3 * np.cos(limit)))

    def draw(axes: Any) -> None:
        ax = axes[0]
        theta = np.linspace(-np.pi / 2, np.pi / 2, 200)
        ring = np.concatenate([(l2 + l3) * np.exp(1j * theta), inner * np.exp(1j * theta[::-1])])
        ax.fill(ring.real, l1 + ring.imag, color=BLUE, alpha=0.18, linewidth=0)
        ax.text(1.06, 0.98, f"within ±{np.degrees(limit):.0f}°", color=BLUE, fontsize=8.5,
                rotation=-62)  # fmt: skip
        for z in world.printed.task.path_heights:
            ax.axhline(z, color=MUTED, linewidth=0.6, linestyle=(0, (4, 2)))
            far, near = (np.sqrt(np.maximum(r**2 - (z - l1) ** 2, 0)) for r in (l2 + l3, inner))
            ax.plot([near, far], [z, z], color=INK, linewidth=3, solid_capstyle="butt")
        ax.plot(0, l1, "o", color=MUTED)
        ax.set_aspect("equal")
        ax.set(xlim=(0, 1.75), ylim=(-0.1, 2.05), xlabel="x [m]", ylabel="z [m]",
               title="Where each height can be reached")  # fmt: skip
        for j, z in enumerate(world.printed.task.path_heights):
            axes[1].plot(x, np.degrees(bend[j]), color=COLOURS[j], label=f"z = {z:g} m")
        axes[1].axhline(np.degrees(limit), color=VERMILION, linestyle=(0, (5, 2)))
        axes[1].text(0.21, np.degrees(limit) - 2, "stated limit", color=VERMILION, va="top",
                     fontsize=8.5)  # fmt: skip
        axes[1].set(xlabel="x of the path [m]", ylabel="joint 3 must bend [°]",
                    title="What a path at one x asks of joint 3")  # fmt: skip
        axes[1].legend(loc="lower left", fontsize=8)

    return PaperFigure(
        "range", "Joint 3's range against Fig. 9's path",
        f"The four heights at one x (black: what is in reach within ±{np.degrees(limit):.0f}° at "
        f"each height; no vertical line meets all four). At the best x, {at:.2f} m, joint 3 must "
        f"bend {least:.0f}°. The figures here go beyond the stated range.",
        "Reach of the arm within the stated joint range, and the bend that the path needs",
        {"least_bend_deg": least, "at_x": at, "limit_deg": float(np.degrees(limit)),
         "x": rounded(x[::8]), "bend_deg": rounded(np.degrees(bend[:, ::8]))},
        draw, columns=2, width=9.4, height=3.6, wide=True,
    )  # fmt: skip
