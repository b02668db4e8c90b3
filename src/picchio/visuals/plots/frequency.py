"""The robot by frequency: its modes, its frequency response, and the measured one beside it."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from picchio.campaign.channels import Channel
from picchio.excitation.excitation import Excitation
from picchio.prediction.residual import Transfer
from picchio.vibration.closed_form.modes import Modes
from picchio.vibration.closed_form.response import unit_vector
from picchio.visuals.plots.diagnosis import BEFORE, MEASURED, plain_numbers, shown_unit
from picchio.visuals.plots.style import (
    GREEN,
    MUTED,
    axes_or_new,
    direction_label,
    look,
    plain,
    styled,
)

_MOST_HARMONICS = 16
_POINTS = 900


@styled
def plot_mode_shapes(modes: Modes, ax: Axes | None = None) -> Axes:
    """The deflection of every joint in every mode, the largest set to 1 (no unit).

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


@styled
def plot_frequency_response(
    modes: Modes,
    direction: ArrayLike = (0.0, 0.0, 1.0),
    ax: Axes | None = None,
    *,
    excitation: Excitation | None = None,
) -> Axes:
    """The deflection per newton of every joint (microradians per newton) over frequency (Hz).

    Args:
        modes: of the robot at a pose.
        direction: (3,) of the force; upwards if not given.
        ax: where to draw.
        excitation: blows whose harmonics to mark.
    """
    ax = axes_or_new(ax)
    f = modes.natural_frequencies
    # Resonances are narrow: half of the points sit on them.
    near = 1 + np.linspace(-0.2, 0.2, _POINTS // 8) ** 3 / 0.04
    frequency = np.union1d(np.geomspace(f[0] / 6.0, 2.2 * f[-1], _POINTS), np.outer(f, near))
    gain = np.abs(
        np.einsum("mdk,d->mk", modes.frequency_response(2 * np.pi * frequency),
                  unit_vector(direction))
    )  # fmt: skip
    if excitation is not None:
        inside = int(frequency[-1] * excitation.period)
        harmonics = np.arange(1, min(inside, _MOST_HARMONICS) + 1) / excitation.period
        for k, harmonic in enumerate(harmonics):
            ax.axvline(harmonic, color=MUTED, linewidth=0.8, linestyle=":",
                       label="harmonics of the blows" if k == 0 else None)  # fmt: skip
    for j, name in enumerate(modes.output_names):
        ax.loglog(frequency, gain[j] * 1e6, label=plain(name), **look(j))
    top = float(gain.max()) * 1e6
    ax.set_ylim(1e-5 * top, 2.0 * top)
    ax.set_xlim(frequency[0], frequency[-1])
    along = direction_label(unit_vector(direction))
    ax.set(xlabel="frequency [Hz]", ylabel="deflection per force [µrad/N]",
           title=f"Frequency response, force along {along}")  # fmt: skip
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return ax


@styled
def plot_transfer(
    found: Transfer,
    channel: Channel,
    ax: Axes | None = None,
    *,
    highest: float | None = None,
) -> Axes:
    """The magnitude of response over force, measured and simulated; coherence on the right.

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
    ax.set(xscale="log", yscale="log")
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
