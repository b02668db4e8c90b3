"""From a first look at an accelerometer's log to one self-contained HTML page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from picchio.ledger.first_look import FirstLook, Vibration
from picchio.visuals.plots.style import BLUE, INK, VERMILION, axes_or_new, look, plain, styled
from picchio.visuals.report.page import Pictures, plain_page

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLUMNS = 2000  # of a picture: in each the least and the largest sample are drawn


def first_look_page(
    found: FirstLook, *, command: str | None = None, warnings: Sequence[str] = ()
) -> str:
    """The page of a first look: what it says, the readings, the spectrum.

    Args:
        found: the look.
        command: the command line that gave this.
        warnings: what was warned of on the way.

    Returns:
        the HTML.
    """
    made, pictures = Pictures(), []
    if (seen := found.vibration) is not None:
        pictures = [
            made.picture(plot_readings(seen), "Readings over time",
                         "What the accelerometer reads, less its value at rest; marks: blows."),
            made.picture(plot_spectrum(seen), "Power spectral density",
                         "All axes together; lines: where it rings after the blows."),
        ]  # fmt: skip
    return plain_page(found, command=command, warnings=warnings, pictures=pictures,
                      sentences=found.told)  # fmt: skip


@styled
def plot_readings(seen: Vibration, ax: Axes | None = None) -> Axes:
    """The readings over time, s, and where blows begin.

    Args:
        seen: of an accelerometer.
        ax: where to draw.
    """
    ax = axes_or_new(ax)
    count = max(len(seen.time) // _COLUMNS, 1)
    edges = np.arange(0, len(seen.time), count)
    for k, name in enumerate(seen.sensor.series.values()):
        values = seen.values[:, k] / seen.scale
        low, high = np.minimum.reduceat(values, edges), np.maximum.reduceat(values, edges)
        both = np.column_stack([low, high]).ravel()
        ax.plot(np.repeat(seen.time[edges], 2), both, label=plain(name), linewidth=0.7,
                color=look(k)["color"])  # fmt: skip
    top = float(np.abs(seen.values).max()) / seen.scale
    ax.plot(seen.onsets, np.full(len(seen.onsets), 1.08 * top), "v", color=INK, markersize=3)
    ax.set(xlabel="time [s]", ylabel=f"acceleration [{seen.unit}]")
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return ax


@styled
def plot_spectrum(seen: Vibration, ax: Axes | None = None) -> Axes:
    """The power spectral density of all axes over frequency, Hz, and where the structure rings.

    Args:
        seen: of an accelerometer.
        ax: where to draw.
    """
    ax = axes_or_new(ax)
    inside = seen.frequency > 0.0
    ax.loglog(seen.frequency[inside], seen.density[inside] / seen.scale**2, color=BLUE)
    for k, ringing in enumerate(seen.ringing):
        ax.axvline(ringing.frequency, color=VERMILION, linestyle=":", linewidth=1.0,
                   label="rings" if k == 0 else None)  # fmt: skip
    ax.set(xlabel="frequency [Hz]", ylabel=f"density [({seen.unit})$^2$/Hz]")
    if seen.ringing:
        ax.legend(loc="upper right")
    return ax
