"""Residuals: by record and channel, frequency, time and condition, and the torque they imply."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from picchio.core.arrays import BoolArray, FloatArray
from picchio.robot.units import SLIDING, TURNING
from picchio.visuals.plots.diagnosis import AFTER, BEFORE, plain_numbers
from picchio.visuals.plots.style import (
    BLUE,
    CMAP,
    COLOURS,
    INK,
    MUTED,
    VERMILION,
    axes_or_new,
    look,
    plain,
    styled,
)

_MOST_HARMONICS = 60
_MOST_ROWS = 60
_MOST_DOTS = 700
_BINS, _FINE_BINS = 15, 25
_FEWEST = 8  # samples of a bin
_PLOTTED = 1500  # lines of a spectrum


@styled
def plot_residual_map(
    times: ArrayLike,
    records: Sequence[str],
    channels: Sequence[str],
    ax: Axes | None = None,
) -> Axes:
    """Every channel of every record as a square: the residual over the noise.

    Args:
        times: (records, channels) RMS over the noise; NaN where there is no such channel.
        records: their names.
        channels: their names.
        ax: where to draw.
    """
    from matplotlib.colors import LogNorm

    ax = axes_or_new(ax)
    values = np.asarray(times, dtype=float)
    top = max(float(np.nanmax(values)), 3.0)
    shown = ax.pcolormesh(np.clip(values, 1.0, None), cmap=CMAP, norm=LogNorm(1.0, top),
                          edgecolors="none")  # fmt: skip
    if values.size <= _MOST_ROWS * 8:
        for (i, k), value in np.ndenumerate(values):
            if np.isfinite(value):
                bright = np.log(max(value, 1.0)) > 0.6 * np.log(top)
                ax.text(k + 0.5, i + 0.5, f"{value:.3g}" if value < 1000 else f"{value:.0e}",
                        ha="center", va="center", fontsize=7,
                        color="#000001" if bright else "#fffffe")  # fmt: skip
    ax.set_xticks(np.arange(len(channels)) + 0.5, [plain(c, 30) for c in channels], rotation=30,
                  ha="right")  # fmt: skip
    step = max(1, len(records) // _MOST_ROWS)
    ax.set_yticks(np.arange(0, len(records), step) + 0.5,
                  [plain(r) for r in records[::step]], fontsize=8)  # fmt: skip
    ax.invert_yaxis()
    ax.grid(False)
    bar = ax.figure.colorbar(shown, ax=ax, pad=0.01, aspect=30)
    bar.set_label("residual / noise, RMS")
    plain_numbers(bar.ax.yaxis, 1.0, top)
    return ax


@styled
def plot_residual_spectrum(
    edges: FloatArray,
    power: Mapping[str, FloatArray],
    ax: Axes | None = None,
    *,
    modes: Sequence[tuple[float, float]] = (),
    hit_rate: float | None = None,
) -> Axes:
    """Power over the noise's by frequency, a line a channel group.

    Args:
        edges: (k + 1,) Hz of the bands.
        power: group -> (k,).
        ax: where to draw.
        modes: from and to, Hz, of each natural frequency over the poses.
        hit_rate: Hz; its harmonics are marked.
    """
    ax = axes_or_new(ax)
    for k, (low, high) in enumerate(modes):
        ax.axvspan(low * 0.995, high * 1.005, color=COLOURS[3], alpha=0.22, linewidth=0,
                   label="natural frequencies" if k == 0 else None)  # fmt: skip
    if hit_rate:
        lines = hit_rate * np.arange(1, _MOST_HARMONICS + 1)
        lines = lines[lines < edges[-1]]
        ax.plot(lines, np.zeros(lines.size), "|", color=MUTED, markersize=11, clip_on=False,
                transform=ax.get_xaxis_transform(), label="harmonics of the hits")  # fmt: skip
    for i, (group, values) in enumerate(power.items()):
        middle = np.sqrt(edges[:-1] * edges[1:])
        known = np.isfinite(values)
        ax.plot(middle[known], values[known], label=plain(group), linewidth=1.3, **look(i))
    ax.axhline(1.0, color=MUTED, linewidth=1.2)
    ax.text(1.0, 1.0, " noise", transform=ax.get_yaxis_transform(), va="center", fontsize=8,
            color=MUTED)  # fmt: skip
    ax.set(xscale="log", yscale="log")
    low, high = ax.get_ylim()
    ax.set_ylim(min(low, 0.3), max(high, 4.0))
    ax.set_xlim(edges[0], edges[-1])
    plain_numbers(ax.xaxis, 1.0, 1e2)
    ax.set(xlabel="frequency [Hz]", ylabel="power / noise's power")
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4)
    return ax


@styled
def plot_over_time(
    edges: FloatArray,
    residual: Mapping[str, FloatArray],
    signal: Mapping[str, FloatArray],
    ax: Axes | None = None,
    *,
    last_blow: float | None = None,
) -> Axes:
    """How large residual (lines) and signal (thin, dotted) are, hit by hit, over the noise.

    Args:
        edges: (k + 1,) s of the windows.
        residual: group -> (k,) RMS over the noise.
        signal: the same of the measurement.
        ax: where to draw.
        last_blow: s, when it begins.
    """
    ax = axes_or_new(ax)
    middle = 0.5 * (edges[:-1] + edges[1:])
    for i, group in enumerate(residual):
        colour = look(i)["color"]
        ax.plot(middle, residual[group], "o-", markersize=3, label=plain(group), color=colour)
        ax.plot(middle, signal[group], linestyle=":", linewidth=1.2, color=colour,
                label="the signal" if i == 0 else None)  # fmt: skip
    if last_blow is not None:
        ax.axvspan(0.0, last_blow, color=MUTED, alpha=0.09, linewidth=0)
        ax.text(last_blow, 0.97, "last blow ", transform=ax.get_xaxis_transform(), ha="right",
                va="top", fontsize=8, color=MUTED)  # fmt: skip
    ax.axhline(1.0, color=MUTED, linewidth=1.2)
    ax.set_yscale("log")
    ax.set(xlabel="time [s]", ylabel="RMS / noise")
    ax.set_xlim(edges[0], edges[-1])
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4)
    return ax


@styled
def plot_by_condition(
    values: Sequence[object],
    shares: Mapping[str, Sequence[float]],
    floors: Mapping[str, Sequence[float]],
    what: str,
    ax: Axes | None = None,
) -> Axes:
    """The residual's share of the signal, a dot a record, by one thing that differs among them.

    Args:
        values: of each record; numbers or names.
        shares: group -> residual over signal of each record.
        floors: the same of noise alone; drawn as small dashes.
        what: the axis's label.
        ax: where to draw.
    """
    ax = axes_or_new(ax)
    names = [v for v in dict.fromkeys(values) if isinstance(v, str)]
    x = np.array([names.index(v) if isinstance(v, str) else v for v in values])
    for i, group in enumerate(shares):
        at = x + (0.12 * (i - 0.5 * (len(shares) - 1)) if names else 0.0)
        style: dict[str, Any] = {"color": COLOURS[i % len(COLOURS)], "linestyle": ""}
        ax.plot(at, 100.0 * np.asarray(shares[group]), marker="osD^v"[i % 5], markersize=4.5,
                label=plain(group), **style)  # fmt: skip
        ax.plot(at, 100.0 * np.asarray(floors[group]), marker="_", markersize=8, alpha=0.7,
                label="noise alone" if i == 0 else None, **style)  # fmt: skip
    if names:
        ax.set_xticks(range(len(names)), [plain(n, 22) for n in names],
                      rotation=30 if len(names) > 5 else 0,
                      ha="right" if len(names) > 5 else "center")  # fmt: skip
    ax.set_yscale("log")
    plain_numbers(ax.yaxis, *ax.get_ylim())
    ax.set(xlabel=what, ylabel="residual / signal [%]")
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4)
    ax.tick_params(axis="x", labelsize=8)
    return ax


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
    bins = bins_of(x, _BINS)
    ax.plot([np.median(x[k]) for k in bins], [np.median(y[k]) for k in bins],
            "o-", color=VERMILION, markersize=3.5, linewidth=1.6, label="median")  # fmt: skip
    ax.axvline(0.0, color=MUTED, linewidth=0.8)
    _frame_most(ax, y)
    units = SLIDING if prismatic else TURNING
    length = units.length if whole else units.small
    unit = f"{length}/s" if over == "velocity" else length
    ax.set(xlabel=f"{over} of {plain(joint)} [{unit}]",
           ylabel=f"missing {units.load_word} [{units.load}]")  # fmt: skip
    return ax


def bins_of(x: FloatArray, count: int) -> list[BoolArray]:
    """`count` bins of x with as many samples each, as masks; those with few samples left out."""
    edges = np.quantile(x, np.linspace(0.0, 1.0, count + 1))
    place = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, count - 1)
    found = [place == k for k in range(count)]
    return [mask for mask in found if mask.sum() >= _FEWEST]


def _frame_most(ax: Axes, values: FloatArray) -> None:
    """The zero line, and limits that leave out what is rarest."""
    ax.axhline(0.0, color=MUTED, linewidth=0.8)
    low, high = np.quantile(values, [0.002, 0.998])
    room = 0.15 * max(high - low, 1e-12)
    ax.set_ylim(low - room, high + room)


@styled
def plot_clouds(
    x: FloatArray,
    before: FloatArray,
    after: FloatArray | None,
    x_label: str,
    y_label: str,
    ax: Axes | None = None,
) -> Axes:
    """What is left over something of the motion: every sample, and the running median.

    Args:
        x: (m,) in the label's unit.
        before: (m,) left by the baseline.
        after: (m,) left by the extended model, or None.
        x_label: with its unit.
        y_label: with its unit.
        ax: where to draw.
    """
    ax = axes_or_new(ax)
    step = max(1, x.size // _MOST_DOTS)
    bins = bins_of(x, _FINE_BINS)
    for values, style, label in ((before, BEFORE, "before"), (after, AFTER, "after")):
        if values is None:
            continue
        ax.plot(x[::step], values[::step], ".", color=style["color"], markersize=2.0, alpha=0.3)
        ax.plot([np.median(x[k]) for k in bins], [np.median(values[k]) for k in bins],
                label=label if after is not None else "median", linewidth=1.8, **style)  # fmt: skip
    _frame_most(ax, before)
    ax.set(xlabel=x_label, ylabel=y_label)
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    return ax


@styled
def plot_orders(
    orders: FloatArray,
    before: FloatArray,
    after: FloatArray,
    found: Sequence[float],
    ax: Axes | None = None,
    *,
    per: str = "turn of the motor",
) -> Axes:
    """A residual's power over its neighbourhood's, by the order; 1 is noise.

    Args:
        orders: (k,) cycles a turn, or a metre.
        before: (k,).
        after: (k,).
        found: orders of the ripples that were found.
        ax: where to draw.
        per: what the cycles are counted over.
    """
    ax = axes_or_new(ax)
    # Of every few lines the highest, so that none of the narrow ones is lost.
    step = max(1, orders.size // _PLOTTED)
    rows = np.arange(orders.size // step) * step
    for values, style, label in ((before, BEFORE, "before"), (after, AFTER, "after")):
        parts = values[: rows.size * step].reshape(rows.size, step)
        ax.plot(orders[rows + parts.argmax(axis=1)], np.maximum(parts.max(axis=1), 0.3),
                label=label, linewidth=1.0, color=style["color"])  # fmt: skip
    ax.axhline(1.0, color=MUTED, linewidth=1.2, label="noise")
    ax.set_yscale("log")
    high = float(before.max())
    ax.set_ylim(0.5, 4.0 * high)
    ax.set_xlim(0.0, float(orders[-1]))
    for order in found:
        top = before[np.abs(orders - order) <= 0.1].max(initial=0.0) or 1.0
        ax.annotate(f"{order:.4g}", (order, top), xytext=(0, 3),
                    textcoords="offset points", ha="center", fontsize=8, color=INK)  # fmt: skip
    plain_numbers(ax.yaxis, 0.5, 4.0 * high)
    ax.set(xlabel=f"cycles a {per}",
           ylabel="power / its neighbourhood's")  # fmt: skip
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    return ax
