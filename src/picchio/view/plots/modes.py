"""The robot's modes: where they lie and which joints move in them."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from picchio.excitation import Excitation
from picchio.vibration import Modes
from picchio.view.plots.style import (
    BLUE,
    INK,
    MUTED,
    axes_or_new,
    look,
    plain,
    styled,
)


@styled
def plot_natural_frequencies(
    modes: Modes, ax: Axes | None = None, *, excitation: Excitation | None = None
) -> Axes:
    """Natural frequency (Hz) and damping of every mode; the blows' harmonics as thin lines.

    Args:
        modes: of the robot at a pose.
        ax: where to draw.
        excitation: blows whose harmonics to mark.
    """
    frequency = modes.natural_frequencies
    ax = axes_or_new(ax, height=1.1 + 0.32 * frequency.size)
    if excitation is not None:
        harmonics = np.arange(1, int(1.25 * frequency.max() * excitation.period) + 2)
        for k, f in enumerate(harmonics / excitation.period):
            ax.axvline(f, color=MUTED, linewidth=0.8, linestyle=":", alpha=0.6,
                       label=f"harmonics of the blows, {1 / excitation.period:g} Hz apart"
                       if k == 0 else None)  # fmt: skip
    row = np.arange(frequency.size)
    ax.hlines(row, 0.0, frequency, color=BLUE, linewidth=2.2)
    ax.plot(frequency, row, "o", color=BLUE, markersize=7)
    for y, (f, ratio) in enumerate(zip(frequency, modes.damping_ratios, strict=True)):
        ax.annotate(f"{f:.3g} Hz, {100 * ratio:.2g} %", (f, y), xytext=(8, 0), color=INK,
                    textcoords="offset points", va="center", fontsize=8.5)  # fmt: skip
    ax.set_yticks(row, [f"mode {k + 1}" for k in row])
    ax.set(xlabel="natural frequency [Hz], damping ratio [%]", title="Natural frequencies")
    ax.set_xlim(0.0, 1.25 * float(frequency.max()))
    ax.set_ylim(frequency.size - 0.4, -0.6)
    ax.grid(axis="y", visible=False)
    if excitation is not None:
        ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)
    return ax


@styled
def plot_mode_shapes(modes: Modes, ax: Axes | None = None) -> Axes:
    """Deflection of every joint in every mode, the largest set to 1 (no unit).

    Args:
        modes: of the robot at a pose.
        ax: where to draw.
    """
    shapes = modes.mode_shapes
    shapes = shapes / shapes[np.abs(shapes).argmax(axis=0), np.arange(shapes.shape[1])]
    n = len(shapes)
    ax = axes_or_new(ax, height=2.9)
    width = 0.8 / n
    names = modes.output_names if len(modes.output_names) == n else [f"{j + 1}" for j in range(n)]
    for j in range(n):
        ax.bar(np.arange(n) + (j - (n - 1) / 2) * width, shapes[j], 0.88 * width,
               color=look(j)["color"], label=plain(names[j]))  # fmt: skip
    ax.axhline(0.0, color=MUTED, linewidth=0.8)
    ax.set_xticks(
        np.arange(n), [f"mode {k + 1}\n{f:.3g} Hz" for k, f in enumerate(modes.natural_frequencies)]
    )
    ax.set(ylabel="relative deflection [\N{EN DASH}]", title="Mode shapes")
    ax.set_ylim(-1.12, 1.12)
    ax.grid(axis="x", visible=False)
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return ax
