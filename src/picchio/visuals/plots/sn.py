"""The S-N curve with the task's poses on it, and a curve fitted to tests."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from statistics import NormalDist

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from picchio.fatigue.sn.curve import SNCurve
from picchio.fatigue.sn.fit import SNFit
from picchio.visuals.plots.style import (
    BLUE,
    COLOURS,
    GREY,
    INK,
    MUTED,
    ORANGE,
    VERMILION,
    axes_or_new,
    plain,
    styled,
)

_MARKERS = "osD^vP*X"
_LEFT, _RIGHT = 1e3, 1e9


@styled
def plot_sn_curve(
    curve: SNCurve,
    ax: Axes | None = None,
    *,
    amplitudes: Mapping[str, ArrayLike] | None = None,
) -> Axes:
    """The shear stress amplitude (MPa) over cycles to failure, with a task's amplitudes on it.

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


@styled
def plot_sn_fit(fit: SNFit, ax: Axes | None = None) -> Axes:
    """A fitted S-N curve (MPa over cycles) and its tests: median, P10 and P90, how sure they are.

    P10 is the life that 90 % of specimens exceed. The band is where the median itself may lie, at
    the fit's level; the bar at the knee is the knee's interval. Failures are dots, run-outs rings
    with an arrow.

    Args:
        fit: the fit.
        ax: where to draw.
    """
    ax = axes_or_new(ax, height=3.8)
    tests = fit.tests
    ends = [fit.reference_cycles, *tests.cycles]
    if fit.knee is not None:
        # A knee that the tests do not bound may lie anywhere: its bar then runs to the edges.
        near = np.clip([fit.knee.low, fit.knee.high], 0.1 * min(ends), 10.0 * max(ends))
        ends += near.tolist()
    left, right = 0.4 * min(ends), 4.0 * max(ends)
    cycles = np.union1d(np.geomspace(left, right, 200), [fit.reference_cycles])
    low, high = fit.band(cycles)
    ax.fill_between(cycles, low / 1e6, high / 1e6, color=BLUE, alpha=0.16, linewidth=0,
                    label=f"{100 * fit.level:g} % confidence of the median")  # fmt: skip
    for survival, dashes, label in ((0.5, "-", "median"), (0.9, (0, (5, 1.6)), "P10 and P90"),
                                    (0.1, (0, (5, 1.6)), "_P90")):  # fmt: skip
        strength = fit.curve(survival).amplitude(cycles) / 1e6
        width = 1.8 if survival == 0.5 else 1.2
        ax.loglog(cycles, strength, color=BLUE, linestyle=dashes, linewidth=width, label=label)
    if fit.knee is not None:
        limit = fit.endurance_limit.value / 1e6
        reach = np.clip([fit.knee.low, fit.knee.high], left, right)
        ax.plot(reach, [limit, limit], "|-", color=INK, linewidth=1.4, markersize=9, zorder=5,
                label=f"knee, {100 * fit.level:g} % interval")  # fmt: skip
        ax.plot(fit.knee.value, limit, "o", color=INK, markersize=4, zorder=5, label="_knee")
    stress, broken = tests.amplitude / 1e6, tests.failed
    ax.plot(tests.cycles[broken], stress[broken], "o", color=VERMILION, label="failure",
            markersize=5, markeredgecolor="white", markeredgewidth=0.6, zorder=4)  # fmt: skip
    unbroken = list(zip(tests.cycles[~broken], stress[~broken], strict=True))
    if unbroken:
        ax.plot(*np.transpose(unbroken), "o", color=ORANGE, label="run-out", markersize=5.5,
                markerfacecolor="none", markeredgewidth=1.3, zorder=4)  # fmt: skip
    for place, many in Counter(unbroken).items():
        ax.annotate("", (1.75 * place[0], place[1]), xytext=(1.12 * place[0], place[1]),
                    arrowprops={"arrowstyle": "->", "color": ORANGE, "lw": 1.2})  # fmt: skip
        if many > 1:
            ax.annotate(f"{many}", (1.75 * place[0], place[1]), xytext=(-2, 3),
                        textcoords="offset points", fontsize=8, color=MUTED)  # fmt: skip
    ax.set_xlim(left, right)
    _few_stress_ticks(ax)
    ax.set(xlabel="cycles to failure [\N{EN DASH}]", ylabel="shear stress amplitude [MPa]",
           title=f"S-N fit: {fit.failures} failures, {fit.run_outs} run-outs")  # fmt: skip
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return ax


def _few_stress_ticks(ax: Axes) -> None:
    """Round ticks within less than a decade, where a logarithmic axis has next to none."""
    from matplotlib.ticker import FixedLocator, MaxNLocator, NullFormatter, ScalarFormatter

    bottom, top = ax.get_ylim()
    if top / bottom > 15.0:
        return
    ticks = [t for t in MaxNLocator(6).tick_values(bottom, top) if bottom <= t <= top]
    ax.yaxis.set_major_locator(FixedLocator(ticks))
    ax.yaxis.set_major_formatter(ScalarFormatter())
    ax.yaxis.set_minor_formatter(NullFormatter())


def _finite(values: ArrayLike) -> np.ndarray:
    array = np.atleast_1d(np.asarray(values, dtype=float)).ravel()
    return array[np.isfinite(array)]
