"""Fig. 10: maps of the arm's plane, and what they say of x- and z-forces."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from picchio.core.arrays import FloatArray
from picchio.paper.figures.base import PaperFigure, rounded
from picchio.paper.reach import ReachMap
from picchio.paper.study import Study
from picchio.paper.verdict import plainly
from picchio.visuals.plots.style import CMAP, INK, MUTED, VERMILION, look

_NAMES = {"worst": "worst direction", "x": "force along x", "z": "force along z"}


def figure_10(study: Study) -> PaperFigure:
    """Three joints by the worst direction, and by forces along x and z."""
    reach = study.base.reach
    maps = {"worst": reach.worst, "x": reach.along["x"], "z": reach.along["z"]}

    def draw(axes: Any) -> None:
        for r, (name, peaks) in enumerate(maps.items()):
            for j in range(3):
                _map(axes[r, j], reach, peaks, j, f"Joint {j + 1}, {_NAMES[name]}")
                axes[r, j].set_xlabel("x [m]" if r == 2 else "")
            axes[r, 0].set_ylabel("z [m]")

    tops = {name: [rounded(reach.top(peaks, j)) for j in range(3)] for name, peaks in maps.items()}
    return PaperFigure(
        "fig-10", "Fig. 10: largest deflection over the workspace",
        "Peak deflection [mrad] within the stated joint limits, one elbow, mirrored to the left. "
        "Dots: where it is largest. First row: each joint's own worst direction; below, the "
        "forces along x and z of which the paper's explanation speaks. Its colours cannot be "
        "compared: the figures are not in the text.",
        "Nine maps of the x-z plane: three joints, by worst direction, force along x, along z",
        {"place": rounded(reach.place[::4, ::4], 4), "bend": rounded(reach.bend[::4]),
         "peak_mrad": {name: rounded(peaks[::4, ::4], 4) for name, peaks in maps.items()},
         "largest_at": tops}, draw, columns=3, rows=3, width=10.8, height=9.2, wide=True,
    )  # fmt: skip


def _map(ax: Axes, reach: ReachMap, peaks: FloatArray, j: int, title: str) -> None:
    x, z, p = reach.place[..., 0], reach.place[..., 2], peaks[..., j]
    top = float(p.max())
    ax.set_aspect("equal")
    ax.set(xlim=(-1.7, 1.7), ylim=(-1.3, 2.1), title=title)
    if top < 1e-9:
        levels = np.array([0.0, 1.0])
        for side in (1, -1):
            ax.contourf(side * x, z, p, levels=levels, colors=["#46326b"])
        ax.text(0, reach.hub, "nothing", ha="center", va="center", color=MUTED)
        return
    levels = np.linspace(0.0, top, 13)
    for side in (1, -1):
        shown = ax.contourf(side * x, z, p, levels=levels, cmap=CMAP)
    bar = ax.figure.colorbar(shown, ax=ax, shrink=0.75, pad=0.01, ticks=levels[::4])
    bar.outline.set_visible(False)  # type: ignore[operator]
    bar.ax.set_yticklabels([f"{level:.2g}" for level in levels[::4]])
    at = reach.top(peaks, j)
    for side in (1, -1):
        ax.plot(side * at[0], at[2], "o", color=VERMILION, markersize=5, markeredgecolor="white")


def rings(study: Study) -> PaperFigure:
    """Joints 2 and 3 by the worst direction, over the turn of joint 2."""
    reach = study.base.reach
    angle = np.degrees(np.linspace(-1.0, 1.0, len(reach.worst)) * study.printed.arm.limits[1])
    spread = float(np.ptp(reach.worst[:, :, 1:], axis=0).max() / reach.worst[:, :, 1:].max())
    bends = [0, len(reach.bend) // 2, len(reach.bend) - 1]

    def draw(ax: Axes) -> None:
        for k, b in enumerate(bends):
            for j in (1, 2):
                bent = abs(np.degrees(reach.bend[b]))
                ax.plot(angle, reach.worst[:, b, j], **look(j), linewidth=1.0 + 0.7 * k,
                        label=f"joint {j + 1}, bent {bent:.0f}°")  # fmt: skip
        ax.set(xlabel="joint 2 [°], from straight down to straight up",
               ylabel="peak deflection [mrad]")  # fmt: skip
        ax.set_ylim(0.0, None)
        ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))

    return PaperFigure(
        "rings", "Worst-direction maps must be rings",
        "Turning joint 2 turns arm and worst direction together: over its whole range the peaks "
        f"of joints 2 and 3 change by {spread:.1g} of themselves. So no end, up, down or out, can "
        "be worse than another, as Fig. 10 (b) and (c) are said to show.",
        "Peak deflections over the angle of joint 2: horizontal lines",
        {"angle_deg": rounded(angle), "joint_2": rounded(reach.worst[:, bends, 1]),
         "joint_3": rounded(reach.worst[:, bends, 2]), "spread": spread}, draw, height=3.2,
    )  # fmt: skip


def axis_forces(study: Study) -> tuple[PaperFigure, PaperFigure]:
    """Joint 1 under x, joint 2 under x and z, with the arm stretched out."""
    world = study.base
    turn = np.linspace(-1.0, 1.0, 241) * study.printed.arm.limits[1]
    angle = np.degrees(turn)
    poses = np.stack([0.0 * turn, turn, 0.0 * turn], axis=-1)
    straight = {
        axis: 1e3 * world.peaks(poses, np.eye(3)[k]).peak_deflection for k, axis in enumerate("xyz")
    }
    worst = 1e3 * world.peaks(poses).peak_deflection

    def draw_x(ax: Axes) -> None:
        for k, axis in enumerate("yxz"):
            ax.plot(angle, straight[axis][:, 0], label=f"force along {axis}", **look(k))
        ax.set(xlabel="joint 2 [°], arm straight; 0: full reach along x",
               ylabel="joint 1, peak [mrad]")  # fmt: skip
        ax.legend(loc="upper right")
        ax.margins(y=0.15)

    def draw_z(ax: Axes) -> None:
        for k, axis in enumerate("xz"):
            ax.plot(angle, straight[axis][:, 1], label=f"force along {axis}", **look(k))
        ax.plot(angle, worst[:, 1], color=INK, linewidth=1, label="worst direction")
        ax.set(xlabel="joint 2 [°], arm straight; ±90: full reach along z",
               ylabel="joint 2, peak [mrad]")  # fmt: skip
        ax.legend(loc="lower left")
        ax.set_ylim(0.0, None)

    x_worst = float(straight["x"][:, 0].max())
    up = float(straight["z"][-1, 1] / straight["x"][-1, 1])
    return (
        PaperFigure(
            "x-force", "A force along x and joint 1",
            "In the x–z plane a force along x points at joint 1's axis: its deflection is "
            f"{plainly(x_worst)} mrad at full reach and anywhere else. A force along y loads it "
            "there. Full reach alone does not make the largest deflection either: a folded arm "
            "turns more lightly, and the blows may meet its mode.",
            "Peak deflection of joint 1 over joint 2's angle for forces along y, x and z",
            {"angle_deg": rounded(angle),
             "joint_1": {a: rounded(straight[a][:, 0]) for a in "xyz"}},
            draw_x, height=3.0,
        ),
        PaperFigure(
            "z-force", "A force along z and joint 2",
            "At full vertical reach a force along z passes through joint 2's axis: it deflects the "
            f"joint {plainly(up)} times as much as one along x does. The sentence is right for x.",
            "Peak deflection of joint 2 over its angle for forces along x and z",
            {"angle_deg": rounded(angle), "joint_2": {a: rounded(straight[a][:, 1]) for a in "xz"}},
            draw_z, height=3.0,
        ),
    )  # fmt: skip
