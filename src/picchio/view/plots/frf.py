"""Measured and simulated frequency response over each other, with the coherence."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from picchio.campaign import Channel
from picchio.prediction.residual_dynamics import Transfer
from picchio.view.plots.diagnosis import BEFORE, MEASURED, shown_unit
from picchio.view.plots.diagnosis_scores import plain_numbers
from picchio.view.plots.style import GREEN, axes_or_new, plain, styled


@styled
def plot_transfer(
    found: Transfer,
    channel: Channel,
    ax: Axes | None = None,
    *,
    highest: float | None = None,
) -> Axes:
    """Magnitude of response over force, measured and simulated; coherence on the right.

    Args:
        found: of one channel.
        channel: which.
        ax: where to draw.
        highest: Hz, to show up to; all where None.
    """
    ax = axes_or_new(ax)
    scale, unit = shown_unit(channel)
    f = found.frequency
    inside = (f > 0.0) & (f <= (highest or float(f[-1])))
    ax.plot(f[inside], scale * np.abs(found.measured[inside]), label="measured", **MEASURED)
    ax.plot(f[inside], scale * np.abs(found.simulated[inside]), label="simulated", **BEFORE)
    ax.set_xscale("log")
    ax.set_yscale("log")
    right = ax.twinx()
    right.plot(f[inside], found.coherence[inside], color=GREEN, linewidth=1.0, linestyle=":")
    ax.plot([], [], color=GREEN, linewidth=1.0, linestyle=":", label="coherence (right)")
    right.set_ylim(0.0, 1.05)
    right.set_ylabel("coherence")
    right.grid(False)
    right.spines["right"].set_visible(True)
    ax.set(xlabel="frequency [Hz]", ylabel=f"{plain(channel.name)}\n[{unit}/N]")
    ax.set_xlim(float(f[inside][0]), float(f[inside][-1]))
    plain_numbers(ax.xaxis, 1.0, 1e2)
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    return ax
