"""The S-N curve, and where the task's poses stand on it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from statistics import NormalDist

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from picchio.fatigue import SNCurve
from picchio.view.plots.style import COLOURS, GREY, INK, MUTED, axes_or_new, plain, styled

_MARKERS = "osD^vP*X"
_LEFT, _RIGHT = 1e3, 1e9


@styled
def plot_sn_curve(
    curve: SNCurve,
    ax: Axes | None = None,
    *,
    amplitudes: Mapping[str, ArrayLike] | None = None,
) -> Axes:
    """Shear stress amplitude (MPa) over cycles to failure, with a task's amplitudes on it.

    An amplitude with a finite life sits on the curve at its life. One without is an arrow at
    the right edge: it could go on for ever.

    Args:
        curve: the S-N curve; with known scatter the band from 10 to 90 % survival is drawn.
        ax: where to draw.
        amplitudes: by name (an operation, a joint): (k,) Pa, equivalent amplitudes.
    """
    ax = axes_or_new(ax)
    given = {name: _finite(values) for name, values in (amplitudes or {}).items()}
    lives = [float(n) for v in given.values() for n in curve.cycles_to_failure(v) if n < math.inf]
    left = min([_LEFT, *(0.3 * n for n in lives if n > 0)])
    right = max([_RIGHT, *(3.0 * n for n in lives), *(30.0 * k for k in curve.knees)])
    cycles = np.union1d(np.geomspace(left, right, 300), np.array(curve.knees))
    strength = curve.amplitude(cycles) / 1e6
    if curve.scatter and curve.survival is not None:
        own = NormalDist().inv_cdf(curve.survival)
        band = [10.0 ** (curve.scatter * (own - NormalDist().inv_cdf(p))) for p in (0.1, 0.9)]
        ax.fill_between(cycles, strength * band[1], strength * band[0], color=GREY, alpha=0.22,
                        linewidth=0, label="10 to 90 % survival")  # fmt: skip
    ax.loglog(cycles, strength, color=INK, linewidth=1.8, label=plain(curve.name))
    limit = curve.endurance_limit
    if limit is not None:
        ax.annotate(f"endurance limit {limit / 1e6:.3g} MPa", (right, limit / 1e6), xytext=(-4, 5),
                    textcoords="offset points", ha="right", fontsize=8.5, color=MUTED)  # fmt: skip
    smallest = float(strength.min())
    for k, (name, values) in enumerate(given.items()):
        life = curve.cycles_to_failure(values)
        colour, marker = COLOURS[k % len(COLOURS)], _MARKERS[k % len(_MARKERS)]
        mortal = np.isfinite(life)
        x = np.where(mortal, life, right * 0.6)
        ax.plot(x, values / 1e6, marker, color=colour, markersize=5.5, markeredgecolor="white",
                markeredgewidth=0.6, zorder=4, label=plain(name))  # fmt: skip
        for y in values[~mortal][:1]:
            ax.annotate("", (right, y / 1e6), xytext=(right * 0.6, y / 1e6),
                        arrowprops={"arrowstyle": "->", "color": colour, "lw": 1.2})  # fmt: skip
        if values.size:
            smallest = min(smallest, float(values[values > 0].min(initial=np.inf)) / 1e6)
    ax.set_xlim(left, right)
    largest = max([float(strength.max()), *(float(v.max(initial=0)) / 1e6 for v in given.values())])
    ax.set_ylim(0.6 * smallest, 1.6 * largest)
    title = "S-N curve in shear, and the task on it" if given else "S-N curve in shear"
    ax.set(xlabel="cycles to failure [\N{EN DASH}]", ylabel="shear stress amplitude [MPa]",
           title=title)  # fmt: skip
    if curve.survival is not None:
        ax.text(0.01, 0.02, f"survival {100 * curve.survival:g} %", transform=ax.transAxes,
                fontsize=8, color=MUTED)  # fmt: skip
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return ax


def _finite(values: ArrayLike) -> np.ndarray:
    array = np.atleast_1d(np.asarray(values, dtype=float)).ravel()
    return array[np.isfinite(array)]
