"""What each joint does to a sinusoidal force, by frequency."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from picchio.excitation import Excitation
from picchio.vibration import Modes
from picchio.vibration.response import unit_vector
from picchio.view.plots.style import MUTED, axes_or_new, direction_label, look, plain, styled

_MOST_HARMONICS = 16


@styled
def plot_frequency_response(
    modes: Modes,
    direction: ArrayLike,
    ax: Axes | None = None,
    *,
    excitation: Excitation | None = None,
    points: int = 900,
) -> Axes:
    """Deflection per newton of every joint (microradians per newton) over frequency (Hz).

    Args:
        modes: of the robot at a pose.
        direction: (3,) of the force.
        ax: where to draw.
        excitation: blows whose harmonics to mark.
        points: of each curve.
    """
    ax = axes_or_new(ax)
    f = modes.natural_frequencies
    # Resonances are narrow: half of the points sit on them.
    spread = np.concatenate(
        [fk * (1 + np.linspace(-0.2, 0.2, points // 8) ** 3 / 0.04) for fk in f]
    )
    frequency = np.union1d(np.geomspace(f[0] / 6.0, 2.2 * f[-1], points), spread)
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
