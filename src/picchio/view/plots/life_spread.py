"""How sure a life is: what 90, 50 and 10 % of the possible worlds exceed."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from picchio.studies.uncertainty import UncertainLife
from picchio.view.plots.style import BLUE, MUTED, VERMILION, axes_or_new, note, plain, styled


@styled
def plot_life_spread(spread: UncertainLife, ax: Axes | None = None) -> Axes:
    """Life of every joint and of the robot (rivets): P10 to P90 as a bar, the median as a dot.

    An end at no life at all is drawn as an arrow at the right edge.
    """
    rows = {**spread.joints, "robot": spread.robot}
    ax = axes_or_new(ax, height=1.1 + 0.36 * len(rows))
    ax.set(xlabel="rivets to failure [\N{EN DASH}]", title="How sure the life is, P10 to P90")
    ax.set_yticks(range(len(rows)), [plain(name) for name in rows])
    ax.set_ylim(len(rows) - 0.4, -0.6)
    ax.grid(axis="y", visible=False)
    lives = np.array([[life.p10, life.p50, life.p90] for life in rows.values()])
    finite = lives[np.isfinite(lives)]
    if not finite.size:
        note(ax, "no life has an end, however the inputs fall within their doubt")
        ax.set_xticks([])
        return ax
    ax.set_xscale("log")
    left, right = 0.4 * float(finite.min()), 4.0 * float(finite.max())
    ax.set_xlim(left, right)
    for y, (name, life) in enumerate(rows.items()):
        colour = VERMILION if name == "robot" and y == len(rows) - 1 else BLUE
        if np.isfinite(life.p10):
            end = min(life.p90, right)
            ax.plot([life.p10, end], [y, y], color=colour, linewidth=5, alpha=0.35,
                    solid_capstyle="butt")  # fmt: skip
            if not np.isfinite(life.p90):
                ax.plot(right, y, ">", color=colour, markersize=8, clip_on=False)
        if np.isfinite(life.p50):
            ax.plot(life.p50, y, "o", color=colour, markersize=7)
        if life.endless > 0.0:
            ax.annotate(f"{100 * life.endless:.0f} % without end", (0.99, y - 0.28), ha="right",
                        xycoords=("axes fraction", "data"), fontsize=8, color=MUTED)  # fmt: skip
    return ax
