"""Measured against simulated: the two over time, and what is left between them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from picchio.campaign import Channel
from picchio.core.arrays import FloatArray
from picchio.view.plots.style import (
    BLUE,
    INK,
    MUTED,
    VERMILION,
    axes_or_new,
    plain,
    styled,
)

BEFORE: dict[str, Any] = {"color": VERMILION, "linestyle": (0, (5, 1.6))}
AFTER: dict[str, Any] = {"color": BLUE, "linestyle": "-"}
MEASURED: dict[str, Any] = {"color": INK, "linewidth": 2.6, "alpha": 0.35}
# Standard deviations of the noise that hold 95 % of it.
_BAND = 1.96
_SHOWN = {"rad": (1e3, "mrad"), "m": (1e3, "mm"), "m/s": (1e3, "mm/s")}


def shown_unit(channel: Channel) -> tuple[float, str]:
    """The factor and the unit that a channel is drawn in."""
    return _SHOWN.get(channel.unit, (1.0, channel.unit))


def telling_window(time: FloatArray, difference: FloatArray, length: float) -> tuple[float, float]:
    """The stretch of a record where two curves differ most, s.

    Args:
        time: (m,) s, uniform.
        difference: (m,) between the two.
        length: s, of the stretch.
    """
    first = int(np.searchsorted(time, -1e-9))
    time, square = time[first:], np.asarray(difference)[first:] ** 2
    step = float(time[1] - time[0])
    count = min(max(int(length / step), 2), time.size)
    sums = np.concatenate([[0.0], np.cumsum(square)])
    start = int(np.argmax(sums[count:] - sums[:-count]))
    return float(time[start]), float(time[start + count - 1])


@styled
def plot_overlay(
    time: ArrayLike,
    measured: ArrayLike,
    simulated: Mapping[str, ArrayLike],
    channel: Channel,
    ax: Axes | None = None,
    *,
    window: tuple[float, float] | None = None,
) -> Axes:
    """A channel as measured, with one or two simulations over it.

    Args:
        time: (m,) s.
        measured: (m,) SI.
        simulated: {label: (m,)}; the first is drawn as the one before, the second as after.
        channel: what it measures.
        ax: where to draw.
        window: s, from and to; all of it where None.
    """
    ax = axes_or_new(ax)
    scale, unit = shown_unit(channel)
    t = np.asarray(time)
    low, high = window or (float(t[0]), float(t[-1]))
    inside = (t >= low - 1e-12) & (t <= high + 1e-12)
    ax.plot(t[inside], scale * np.asarray(measured)[inside], label="measured", **MEASURED)
    for style, (label, values) in zip((BEFORE, AFTER), simulated.items(), strict=False):
        ax.plot(t[inside], scale * np.asarray(values)[inside], label=label, linewidth=1.3, **style)
    ax.set(xlabel="time [s]", ylabel=f"{plain(channel.name)}\n[{unit}]")
    ax.set_xlim(low, high)
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    return ax


@styled
def plot_left_over(
    time: ArrayLike,
    before: ArrayLike,
    after: ArrayLike | None = None,
    ax: Axes | None = None,
    *,
    blows: ArrayLike = (),
    zoom: bool = False,
) -> Axes:
    """What a simulation leaves, in units of the noise, with the band that noise keeps to.

    Args:
        time: (m,) s.
        before: (m,) whitened residual.
        after: (m,) of the better model.
        ax: where to draw.
        blows: s, when each blow begins.
        zoom: draw `after` alone, on its own scale.
    """
    ax = axes_or_new(ax)
    t = np.asarray(time)
    starts = np.asarray(blows, dtype=float)
    if starts.size:
        ax.plot(starts, np.zeros(starts.size), "|", color=MUTED, markersize=9, zorder=0.5,
                transform=ax.get_xaxis_transform(), clip_on=False, label="blows")  # fmt: skip
    if not zoom:
        ax.plot(t, np.asarray(before), label="before" if after is not None else "residual",
                linewidth=1.0, color=BEFORE["color"])  # fmt: skip
    if after is not None:
        ax.plot(t, np.asarray(after), label="after", linewidth=0.8, color=AFTER["color"])
    ax.axhspan(-_BAND, _BAND, color=MUTED, alpha=0.28, linewidth=0, label="95 % of noise")
    ax.set(xlabel="time [s]", ylabel="residual\n[noise std]")
    ax.set_xlim(float(t[0]), float(t[-1]))
    if zoom:
        assert after is not None
        most = max(5.0, 1.1 * float(np.abs(np.asarray(after)).max()))
        ax.set_ylim(-most, most)
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4)
    return ax
