"""Plots that only a diagnosis of motion records has."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from picchio.core.arrays import FloatArray
from picchio.view.plots.diagnosis import AFTER, BEFORE
from picchio.view.plots.diagnosis_scores import plain_numbers
from picchio.view.plots.style import BLUE, GREY, INK, MUTED, axes_or_new, plain, styled

_MOST_DOTS = 600
_BINS = 25
_SHOWN = 1500  # lines of a spectrum
_LINES = 5


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
    edges = np.quantile(x, np.linspace(0.0, 1.0, _BINS + 1))
    place = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, _BINS - 1)
    bins = [k for k in range(_BINS) if (place == k).sum() >= 8]
    for values, style, label in ((before, BEFORE, "before"), (after, AFTER, "after")):
        if values is None:
            continue
        ax.plot(x[::step], values[::step], ".", color=style["color"], markersize=2.0, alpha=0.3)
        middle = [float(np.median(x[place == k])) for k in bins]
        ax.plot(middle, [float(np.median(values[place == k])) for k in bins],
                label=label if after is not None else "median", linewidth=1.8, **style)  # fmt: skip
    ax.axhline(0.0, color=MUTED, linewidth=0.8)
    low, high = np.quantile(before, [0.002, 0.998])
    room = 0.15 * max(high - low, 1e-300)
    ax.set_ylim(low - room, high + room)
    ax.set(xlabel=x_label, ylabel=y_label)
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    return ax


@styled
def plot_orders(
    orders: FloatArray,
    before: FloatArray,
    after: FloatArray | None,
    found: Sequence[float],
    ax: Axes | None = None,
    *,
    geared: bool = True,
) -> Axes:
    """A residual's power over its neighbourhood's, by the order; 1 is noise.

    Args:
        orders: (k,) cycles a turn.
        before: (k,).
        after: (k,), or None.
        found: orders of the ripples that were found.
        ax: where to draw.
        geared: whether turns are the motor's.
    """
    ax = axes_or_new(ax)
    for values, style, label in ((before, BEFORE, "before"), (after, AFTER, "after")):
        if values is not None:
            x, y = _crests(orders, values)
            ax.plot(x, y, label=label, linewidth=1.0, color=style["color"])
    ax.axhline(1.0, color=MUTED, linewidth=1.2, label="noise")
    ax.set_yscale("log")
    high = float(before.max())
    ax.set_ylim(0.5, 4.0 * high)
    ax.set_xlim(0.0, float(orders[-1]))
    for order in found:
        ax.annotate(f"{order:.4g}", (order, _top(orders, before, order)), xytext=(0, 3),
                    textcoords="offset points", ha="center", fontsize=8, color=INK)  # fmt: skip
    plain_numbers(ax.yaxis, 0.5, 4.0 * high)
    ax.set(xlabel=f"cycles a turn of the {'motor' if geared else 'joint'}",
           ylabel="power / its neighbourhood's")  # fmt: skip
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    return ax


def _crests(orders: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The highest of every few lines, so that none of the narrow ones is lost."""
    step = max(1, orders.size // _SHOWN)
    count = orders.size // step
    parts = values[: count * step].reshape(count, step)
    at = np.arange(count) * step + parts.argmax(axis=1)
    return orders[at], np.maximum(parts.max(axis=1), 0.3)


def _top(orders: FloatArray, values: FloatArray, order: float) -> float:
    near = np.abs(orders - order) <= 0.1
    return float(values[near].max()) if near.any() else 1.0


@styled
def plot_motion_scores(
    scores: Sequence[Mapping[str, Any]],
    ax: Axes | None = None,
    *,
    accepted: Collection[tuple[str, str]] = (),
) -> Axes:
    """What each candidate takes of the residual on stretches that it was not fitted to.

    Args:
        scores: of one step of the search: dicts with effect, target, share, rank; best first.
        ax: where to draw.
        accepted: (effect, target) of those that were added.
    """
    ax = axes_or_new(ax)
    for place, row in enumerate(scores):
        stands = (row["effect"], row["target"]) in accepted
        share = 100.0 * max(row["share"], 0.0)
        ax.barh(place, share, height=0.62, color=BLUE if stands else GREY,
                alpha=1.0 if stands else 0.6)  # fmt: skip
        note = f"{share:.3g} %; evidence {row['rank']:,.0f}".replace("-", "\N{MINUS SIGN}")
        ax.text(share + 1.2, place, note, va="center", fontsize=8, color=INK if stands else MUTED)
    ax.set_xlim(0.0, 128.0)
    ax.set_xticks(range(0, 101, 20))
    ax.set_ylim(len(scores) - 0.4, -0.6)
    names = [_name(row) for row in scores]
    ax.set_yticks(range(len(scores)), names)
    for label, row in zip(ax.get_yticklabels(), scores, strict=True):
        if (row["effect"], row["target"]) in accepted:
            label.set_fontweight("bold")
    ax.grid(False, axis="y")
    ax.set(xlabel="share of what is left in its channels that it takes, on stretches held out [%]")
    return ax


def _name(row: Mapping[str, Any]) -> str:
    order = row.get("parameters", {}).get("order")
    text = f"{row['effect'].replace('_', ' ')}, {row['target']}"
    return plain(text + (f", order {order:.4g}" if order is not None else ""), 44)


@styled
def mark_places(ax: Axes, names: Sequence[str]) -> Axes:
    """Write beside the rings of a drawn robot, in their order, whose they are.

    Rings that lie on each other share a text; texts at the right edge stand on the left.

    Args:
        ax: of `plot_place`.
        names: a text for each cause that was drawn.
    """
    low, high = ax.get_xlim()
    size = max(high - low, float(np.ptp(ax.get_ylim())))
    kept: list[Any] = []
    for text, name in zip(ax.texts, names, strict=False):
        at = np.array(text.xy)  # type: ignore[attr-defined]
        same = [k for k in kept if np.abs(np.array(k.xy) - at).max() < 0.12 * size]
        if same:
            text.set_text("")
            lines = same[0].get_text().split("\n")
            if len(lines) < _LINES:
                same[0].set_text("\n".join([*lines, plain(name, 24)]))
            elif not lines[-1].endswith("\N{HORIZONTAL ELLIPSIS}"):
                same[0].set_text("\n".join([*lines, "\N{HORIZONTAL ELLIPSIS}"]))
            continue
        text.set_text(plain(name, 24))
        text.set_verticalalignment("bottom")
        if at[0] > low + 0.6 * (high - low):
            text.set_horizontalalignment("right")
            text.set_position((-12, 10))
        else:
            text.set_horizontalalignment("left")
            text.set_position((12, 8))
        kept.append(text)
    return ax
