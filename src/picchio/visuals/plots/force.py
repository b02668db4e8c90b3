"""The blows: the force over time, and its harmonics."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from picchio.core.arrays import FloatArray
from picchio.excitation.excitation import Excitation
from picchio.excitation.piecewise import PiecewiseForce
from picchio.model.model import Model
from picchio.visuals.plots.style import BLUE, MUTED, VERMILION, axes_or_new, styled

_PER_PIECE = 24


def sample_force(force: PiecewiseForce, until: float) -> tuple[FloatArray, FloatArray]:
    """Points of the force's graph with both sides of every jump.

    Args:
        force: a history that lasts at least `until`.
        until: s.

    Returns:
        time (k,) s and force (k,) N.
    """
    times, values = [], []
    ends = np.minimum(force.start + force.duration, until)
    for piece, (start, end) in enumerate(zip(force.start, ends, strict=True)):
        if end <= start:
            break
        straight = not force.amplitude[piece]
        u = np.linspace(0.0, end - start, 2 if straight else _PER_PIECE)
        times.append(start + u)
        values.append(force.in_piece(np.full(u.size, piece), u))
    return np.concatenate(times), np.concatenate(values)


@styled
def plot_force_train(
    excitation: Excitation,
    ax: Axes | None = None,
    *,
    hits: int = 3,
    model: Model | None = None,
) -> Axes:
    """The first blows over time, ms and N; the feed force is the dashed line.

    Args:
        excitation: the blows as programmed.
        ax: where to draw; a new figure if not given.
        hits: how many blows are shown.
        model: draws the blows with its effects in them.
    """
    ax = axes_or_new(ax, height=2.6)
    history = excitation.burst(hits) if model is None else model.force(excitation, hits)
    time, force = sample_force(history, hits * excitation.period)
    ax.plot(time * 1e3, force, color=BLUE, label="blows")
    ax.fill_between(time * 1e3, force, color=BLUE, alpha=0.14, linewidth=0)
    mean = excitation.one_period().mean()
    if model is not None and model.changes_blows:
        mean = float(np.trapezoid(force, time)) / (hits * excitation.period)
    ax.axhline(mean, color=VERMILION, linewidth=1.1, linestyle=(0, (5, 2)),
               label=f"mean {mean:.3g} N")  # fmt: skip
    if excitation.preload:
        ax.axhline(excitation.preload, color=MUTED, linewidth=1.1, linestyle=":",
                   label=f"feed force {excitation.preload:g} N")  # fmt: skip
    ax.set(xlabel="time [ms]", ylabel="force [N]", title="Blows of the tool")
    ax.set_xlim(0.0, hits * excitation.period * 1e3)
    ax.margins(y=0.12)
    ax.legend(loc="upper right", ncols=3, bbox_to_anchor=(1.0, 1.16), borderaxespad=0.0)
    return ax


@styled
def plot_force_spectrum(
    excitation: Excitation,
    ax: Axes | None = None,
    *,
    natural_frequencies: FloatArray | None = None,
    model: Model | None = None,
) -> Axes:
    """The amplitude (N) of the blows' harmonics (Hz), some twenty of them, and the robot's modes.

    Args:
        excitation: the blows.
        ax: where to draw.
        natural_frequencies: (n,) Hz, drawn as marks at the top.
        model: takes the blows with its effects in them.

    Raises:
        InputError: an effect of the model that has no steady state.
    """
    ax = axes_or_new(ax, height=2.6)
    period = excitation.one_period() if model is None else model.force(excitation, None)
    first = 1.0 / float(period.end)
    modes = np.zeros(0) if natural_frequencies is None else np.asarray(natural_frequencies)
    top = max(22.0 * first, 1.08 * float(modes.max(initial=0.0)))
    count = max(1, int(top / first))
    coefficients = period.fourier_coefficients(count)
    amplitude = np.abs(coefficients) * np.where(np.arange(count + 1) > 0, 2.0, 1.0)
    frequency = np.arange(count + 1) * first
    ax.vlines(frequency, 0.0, amplitude, color=BLUE, linewidth=1.4)
    ax.plot(frequency, amplitude, "o", color=BLUE, markersize=3.6, label="harmonics")
    if modes.size:
        inside = modes[modes <= top]
        ax.plot(inside, np.full(inside.size, 0.985), "v", transform=ax.get_xaxis_transform(),
                color=VERMILION, markersize=6, clip_on=False, zorder=5,
                label="the robot's modes")  # fmt: skip
        ax.vlines(inside, 0.0, 0.985, transform=ax.get_xaxis_transform(), color=VERMILION,
                  linewidth=0.8, alpha=0.45)  # fmt: skip
    ax.set(xlabel="frequency [Hz]", ylabel="amplitude [N]", title="Spectrum of the blows")
    ax.set_xlim(-0.012 * top, 1.012 * top)
    ax.set_ylim(0.0, 1.22 * float(amplitude.max()))
    ax.legend(loc="upper right", ncols=2, bbox_to_anchor=(1.0, 1.16), borderaxespad=0.0)
    return ax
