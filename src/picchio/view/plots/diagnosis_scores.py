"""The candidates' scores, and the power that is left by frequency."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis

from picchio.diagnosis.percussion.evidence import Level
from picchio.view.plots.diagnosis import AFTER, BEFORE
from picchio.view.plots.style import (
    BLUE,
    GREY,
    INK,
    MUTED,
    VERMILION,
    axes_or_new,
    plain,
    styled,
)

_LOWEST = 0.5


@styled
def plot_scores(
    scores: Sequence[Mapping[str, Any]],
    without: tuple[float, float],
    ax: Axes | None = None,
    *,
    chosen: Collection[tuple[str, str]] = (),
) -> Axes:
    """What each candidate leaves once it is fitted, over the noise, and its score; best on top.

    Args:
        scores: of one step of the search: dicts with effect, target, bic,
            chi_square_per_sample; an infinite bic is one that was dropped early.
        without: BIC, and chi-square per sample, without any of them.
        ax: where to draw.
        chosen: (effect, target) of those that stand at the end.
    """
    ax = axes_or_new(ax)
    rows = sorted(scores, key=lambda row: (row["bic"], row["chi_square_per_sample"]))
    left = [math.sqrt(max(row["chi_square_per_sample"], 1e-6)) for row in rows]
    start = math.sqrt(max(without[1], 1e-6))
    low, high = 0.6 * min(1.0, *left), max(start, *left, 1.3)
    for place, (row, value) in enumerate(zip(rows, left, strict=True)):
        stands = (row["effect"], row["target"]) in chosen
        fall = without[0] - row["bic"]
        if not math.isfinite(fall):
            note = "far behind early on: dropped"
        elif fall <= 0.0:
            note = "does not pay for its numbers"
        else:
            note = f"evidence {fall:,.0f}"
        ax.barh(place, value - low, left=low, height=0.62, color=BLUE if stands else GREY,
                alpha=1.0 if stands else 0.6)  # fmt: skip
        ax.text(value * 1.04, place, f"{value:.3g}", va="center", fontsize=8)
        ax.text(1.01, place, note, va="center", fontsize=8, transform=ax.get_yaxis_transform(),
                color=INK if stands else MUTED)  # fmt: skip
    for x, text in ((1.0, "noise"), (start, "without")):
        ax.axvline(x, color=INK if x == 1.0 else VERMILION, linewidth=1.1, linestyle="--")
        ax.text(x, 1.01, text, ha="center", va="bottom", fontsize=8,
                color=INK if x == 1.0 else VERMILION,
                transform=ax.get_xaxis_transform())  # fmt: skip
    ax.set_xscale("log")
    ax.set_xlim(low, high * (high / low) ** 0.12)
    ax.set_ylim(len(rows) - 0.4, -0.6)
    ax.set_yticks(
        range(len(rows)),
        [plain(f"{row['effect'].replace('_', ' ')}, {row['target']}", 40) for row in rows],
    )
    for label, row in zip(ax.get_yticklabels(), rows, strict=True):
        if (row["effect"], row["target"]) in chosen:
            label.set_fontweight("bold")
    ax.grid(False, axis="y")
    plain_numbers(ax.xaxis, low, high)
    ax.set(xlabel="residual that is left once fitted [× noise, RMS]")
    return ax


def plain_numbers(axis: Axis, low: float, high: float) -> None:
    """Ticks of a logarithmic axis as plain numbers where they are few and short."""
    from matplotlib.ticker import LogLocator, NullFormatter

    wide = high / low > 30.0
    axis.set_major_locator(LogLocator(subs=(1.0,) if wide else (1.0, 2.0, 5.0)))
    if high / low < 1e4:
        axis.set_major_formatter(lambda value, _: f"{value:g}")
    axis.set_minor_formatter(NullFormatter())


def band_edges(level: Level) -> tuple[float, float]:
    """From and to, Hz, of a level by frequency."""
    low, _, high = level.part.removesuffix(" Hz").partition("-")
    return float(low), float(high)


@styled
def plot_bands(
    before: Sequence[Level],
    after: Sequence[Level],
    ax: Axes | None = None,
    *,
    natural_frequencies: Sequence[float] = (),
) -> Axes:
    """The residual's power over the noise's by frequency; 1 is noise.

    Args:
        before: levels of one channel group.
        after: of the same group; may be empty.
        ax: where to draw.
        natural_frequencies: Hz, marked.
    """
    ax = axes_or_new(ax)
    for levels, style, label in (
        (before, BEFORE, "before" if after else "residual"),
        (after, AFTER, "after"),
    ):
        if not levels:
            continue
        edges = [band_edges(level) for level in levels]
        x = np.array([[max(low, _LOWEST), high] for low, high in edges]).ravel()
        y = np.repeat([max(level.power, 1e-3) for level in levels], 2)
        ax.plot(x, y, label=label, linewidth=1.8, **style)
    ax.axhline(1.0, color=MUTED, linewidth=1.2, label="noise")
    inside = [f for f in natural_frequencies if f >= _LOWEST]
    for k, frequency in enumerate(inside):
        ax.axvline(frequency, color=MUTED, linewidth=0.8, linestyle=":", zorder=0.5,
                   label="modes" if k == 0 else None)  # fmt: skip
    ax.set_xscale("log")
    ax.set_yscale("log")
    low, high = ax.get_ylim()
    low, high = min(low, 0.5), max(high, 4.0)
    ax.set_ylim(low, high)
    plain_numbers(ax.yaxis, low, high)
    plain_numbers(ax.xaxis, *ax.get_xlim())
    ax.set(xlabel="frequency [Hz]", ylabel="power / noise's power")
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4)
    return ax
