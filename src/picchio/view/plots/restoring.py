"""The torque a joint's model lacks, over its deflection and over its velocity."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from picchio.view.plots.style import BLUE, MUTED, VERMILION, axes_or_new, plain, styled

_MOST_DOTS = 700
_BINS = 15


@styled
def plot_restoring(
    motion: ArrayLike,
    torque: ArrayLike,
    joint: str,
    ax: Axes | None = None,
    *,
    over: str = "deflection",
    prismatic: bool = False,
) -> Axes:
    """Missing torque (N m) over the joint's motion, with its running median.

    Deflections are in mrad, positions in rad, velocities in mrad/s (mm, m, mm/s).
    A wrong spring shows as a line over the deflection, play as a dead zone, a hardening spring as
    a cubic; wrong damping as a line over the velocity, dry friction as a step.

    Args:
        motion: (m,) rad or rad/s (m, m/s).
        torque: (m,) N m (N).
        joint: its name.
        ax: where to draw.
        over: "deflection", "position" or "velocity".
        prismatic: whether the joint slides.
    """
    ax = axes_or_new(ax)
    whole = over == "position"
    x, y = (1.0 if whole else 1e3) * np.asarray(motion), np.asarray(torque)
    step = max(1, x.size // _MOST_DOTS)
    ax.plot(x[::step], y[::step], ".", color=BLUE, markersize=2.0 if x.size > 300 else 4.0,
            alpha=0.35)  # fmt: skip
    edges = np.quantile(x, np.linspace(0.0, 1.0, _BINS + 1))
    place = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, _BINS - 1)
    bins = [k for k in range(_BINS) if (place == k).sum() >= 8]
    ax.plot([np.median(x[place == k]) for k in bins], [np.median(y[place == k]) for k in bins],
            "o-", color=VERMILION, markersize=3.5, linewidth=1.6, label="median")  # fmt: skip
    ax.axhline(0.0, color=MUTED, linewidth=0.8)
    ax.axvline(0.0, color=MUTED, linewidth=0.8)
    length = ("" if whole else "m") + ("m" if prismatic else "rad")
    unit = f"{length}/s" if over == "velocity" else length
    low, high = np.quantile(y, [0.002, 0.998])
    room = 0.15 * max(high - low, 1e-12)
    ax.set_ylim(low - room, high + room)
    ax.set(xlabel=f"{over} of {plain(joint)} [{unit}]",
           ylabel=f"missing {'force [N]' if prismatic else 'torque [N m]'}")  # fmt: skip
    return ax
