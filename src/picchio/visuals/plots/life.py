"""Life: which joint and operation limit it (utilisation, damage), and how uncertain it is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator

from picchio.core import spoken
from picchio.robot.units import labelled
from picchio.studies.assessment.result import Assessment, JointLife
from picchio.studies.uncertainty.result import LifeScan, UncertainLife
from picchio.visuals.plots.style import (
    BLUE,
    COLOURS,
    ESTIMATED,
    HATCH,
    INK,
    MUTED,
    VERMILION,
    axes_or_new,
    note,
    plain,
    styled,
)


@styled
def plot_utilisation(assessment: Assessment, ax: Axes | None = None) -> Axes:
    """Largest equivalent stress over the allowable (%), by joint and operation.

    A joint without a shaft has no stress, and its row says so. A reducer, where it is known, is
    a diamond: its largest torque, gravity and blows together, over the limit that binds. Where
    values are estimates, bars are of the most likely ones, and a hatched box holds 80 % of the
    drawn cases, of torques over their limits, too.

    Args:
        assessment: of a task.
        ax: where to draw.
    """
    joints, operations = assessment.joints, assessment.operations
    ax = axes_or_new(ax, height=_height(len(joints), len(operations)))
    parts = [value for j in joints for value in (j.utilisation, j.reducer_utilisation)]
    if not np.isfinite(parts).any():
        return plot_peak_torque(assessment, ax)
    values = np.array([100 * operation.utilisation.max(axis=0) for operation in operations])
    used = [100 * j.reducer_utilisation if j.reducer else np.nan for j in joints]
    top = _bars(ax, assessment, values, "no shaft given", used)
    if (most := _likely(ax, joints)) > top:
        ax.set_xlim(0.0, 1.05 * most)
    if max(top, most) > 40.0:
        ax.axvline(100.0, color=VERMILION, linewidth=1.2, linestyle=(0, (5, 2)))
    ax.set(xlabel="largest load over the allowable [%]",
           title="Utilisation by joint and operation")  # fmt: skip
    return ax


def _likely(ax: Axes, joints: Sequence[JointLife]) -> float:
    """Hatched boxes from P10 to P90 of what estimated parts bear, in %; their largest end."""
    ends: list[float] = []
    for row, joint in enumerate(joints):
        if not joint.estimated or not joint.intervals:
            continue
        parts = [joint.intervals.get(key) for key in ("utilisation", "reducer_utilisation")]
        low, high = (100.0 * max(side) for side in zip(*filter(None, parts), strict=True))
        ax.barh(row, high - low, 0.9, left=low, facecolor="none", edgecolor=MUTED, hatch=HATCH,
                linewidth=0.8, zorder=3,
                label=None if ends else ESTIMATED.replace("; ", ";\n"))  # fmt: skip
        ends.append(high)
    if ends:
        ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return max(ends, default=0.0)


@styled
def plot_peak_torque(assessment: Assessment, ax: Axes | None = None) -> Axes:
    """Largest torque of the vibration (N m, N) by joint and operation; needs no shaft."""
    operations = assessment.operations
    ax = axes_or_new(ax, height=_height(len(assessment.joints), len(operations)))
    values = np.array([operation.peak_torque.max(axis=0) for operation in operations])
    units = [joint.units.load for joint in assessment.joints]
    unit, names = labelled(units, [joint.name for joint in assessment.joints])
    _bars(ax, assessment, values, "not computed", names=names)
    ax.set(xlabel=f"peak torque of the vibration [{unit}]", title="Torque by joint and operation")
    return ax


@styled
def plot_damage(assessment: Assessment, ax: Axes | None = None) -> Axes:
    """The damage of a rivet (Miner's sum, mean over the task), stacked by operation.

    Args:
        assessment: of a task.
        ax: where to draw.
    """
    joints, operations = assessment.joints, assessment.operations
    ax = axes_or_new(ax, height=_height(len(joints), 1))
    ax.set(xlabel="damage a rivet, by operation [\N{EN DASH}]", title="Where the life goes")
    total = np.array([joint.damage_per_rivet for joint in joints])
    rows = _rows(ax, [joint.name for joint in joints])
    if not np.nansum(total) > 0.0:
        known = any(joint.sn_curve for joint in joints)
        note(ax, "no damage: every stress stays below the endurance limit" if known
             else "no joint has a shaft, so no damage can be told")  # fmt: skip
        ax.set_xticks([])
        return ax
    left = np.zeros(len(joints))
    for k, operation in enumerate(operations):
        share = np.array([joint.damage_share.get(operation.name, 0.0) for joint in joints])
        part = np.where(np.isfinite(total), total, 0.0) * share
        ax.barh(rows, part, 0.62, left=left, color=COLOURS[k % len(COLOURS)],
                label=plain(operation.name), edgecolor="white", linewidth=0.6)  # fmt: skip
        left = left + part
    for row, (joint, end) in enumerate(zip(joints, left, strict=True)):
        text = "no shaft given" if not joint.sn_curve else "none" if end == 0.0 else f"{end:.3g}"
        ax.annotate(text, (end, row), xytext=(4, 0), textcoords="offset points", va="center",
                    fontsize=8.5, color=MUTED)  # fmt: skip
    ax.set_xlim(0.0, 1.16 * float(left.max()))
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return ax


def _height(joints: int, operations: int) -> float:
    return 0.95 + joints * max(0.3, 0.17 * operations + 0.1)


def _rows(ax: Axes, names: list[str]) -> np.ndarray:
    """A row for each name, from the top."""
    ax.set_yticks(range(len(names)), [plain(name) for name in names])
    ax.set_ylim(len(names) - 0.4, -0.6)
    ax.grid(axis="y", visible=False)
    return np.arange(len(names))


def _bars(
    ax: Axes,
    assessment: Assessment,
    values: np.ndarray,
    missing: str,
    marks: Sequence[float] = (),
    names: list[str] | None = None,
) -> float:
    """Grouped bars of values (operation, joint), a mark a joint; NaN becomes a word."""
    operations = [operation.name for operation in assessment.operations]
    height = 0.8 / len(operations)
    rows = _rows(ax, names or [joint.name for joint in assessment.joints])
    for k, (name, row) in enumerate(zip(operations, values, strict=True)):
        y = rows + (k - (len(operations) - 1) / 2) * height
        known = np.isfinite(row)
        ax.barh(y[known], row[known], 0.86 * height, color=COLOURS[k % len(COLOURS)],
                label=plain(name) if known.any() else None)  # fmt: skip
        for at, value in zip(y[known], row[known], strict=True):
            ax.annotate(f"{value:.3g}", (value, at), xytext=(3, 0), textcoords="offset points",
                        va="center", fontsize=7.5, color=MUTED)  # fmt: skip
    for row in rows[~np.isfinite(values).any(axis=0)]:
        ax.annotate(missing, (0.0, row), xytext=(5, 0), textcoords="offset points", va="center",
                    fontsize=8.5, color=MUTED, style="italic")  # fmt: skip
    for row, mark in zip(rows, marks, strict=False):
        if np.isfinite(mark):
            label = None if "reducer" in ax.get_legend_handles_labels()[1] else "reducer"
            ax.plot(mark, row, "D", color=INK, markersize=6, zorder=4, label=label)
    every = [*values.ravel(), *marks]
    top = float(np.nanmax(every)) if np.isfinite(every).any() else 1.0
    ax.set_xlim(0.0, 1.12 * top or 1.0)
    if len(operations) > 1 or (marks and any(joint.reducer for joint in assessment.joints)):
        ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return top


@styled
def plot_life_spread(spread: UncertainLife, ax: Axes | None = None) -> Axes:
    """The life of every joint and of the robot (rivets): P10 to P90 as a bar, the median as a dot.

    P10 is the life that 90 % of the samples exceed. A bar whose P90 is infinite ends in an arrow
    at the right edge.

    Args:
        spread: the life and its uncertainty.
        ax: where to draw.
    """
    rows = {**spread.joints, "robot": spread.robot}
    ax = axes_or_new(ax, height=1.1 + 0.36 * len(rows))
    ax.set(xlabel="rivets to failure [\N{EN DASH}]", title="Uncertainty of the life, P10 to P90")
    _rows(ax, list(rows))
    lives = np.array([[life.p10, life.p50, life.p90] for life in rows.values()])
    finite = lives[np.isfinite(lives)]
    if not finite.size:
        note(ax, "infinite life for every value of the uncertain inputs")
        ax.set_xticks([])
        return ax
    ax.set_xscale("log")
    left, right = 0.4 * float(finite.min()), 4.0 * float(finite.max())
    ax.set_xlim(left, right)
    for y, (name, life) in enumerate(rows.items()):
        colour = VERMILION if name == "robot" and y == len(rows) - 1 else BLUE
        if np.isfinite(life.p10):
            end = min(life.p90, right)
            ax.plot([life.p10, end], [y, y], color=colour, linewidth=5, alpha=0.35,
                    solid_capstyle="butt")  # fmt: skip
            if not np.isfinite(life.p90):
                ax.plot(right, y, ">", color=colour, markersize=8, clip_on=False)
        if np.isfinite(life.p50):
            ax.plot(life.p50, y, "o", color=colour, markersize=7)
        if life.endless > 0.0:
            ax.annotate(f"{100 * life.endless:.0f} % infinite", (0.99, y - 0.28), ha="right",
                        xycoords=("axes fraction", "data"), fontsize=8, color=MUTED)  # fmt: skip
    return ax


@styled
def plot_life_scan(name: str, scan: LifeScan, ax: Axes | None = None) -> Axes:
    """The robot's life (rivets) against a factor on one stiffness; it breaks where it is unlimited.

    Args:
        name: of the stiffness, such as "stiffness.joint_2".
        scan: the lives along it.
        ax: where to draw.
    """
    ax = axes_or_new(ax, height=2.7)
    ax.set(
        xlabel=f"factor on {name} [\N{EN DASH}]", ylabel="rivets to failure [\N{EN DASH}]",
        title=f"Life along {name}", xscale="log", yscale="log",
    )  # fmt: skip
    life = np.where(np.isfinite(scan.life), scan.life, np.nan)
    ax.plot(scan.factor, life, color=VERMILION)
    turns = [k for k in scan.turning_points() if np.isfinite(scan.life[k])]
    ax.plot(scan.factor[turns], scan.life[turns], "o", color=VERMILION, markersize=5)
    ax.axvline(1.0, color=MUTED, linewidth=0.8, linestyle=":")
    ax.annotate("as stated", (1.0, 0.98), xycoords=("data", "axes fraction"), ha="left", va="top",
                xytext=(4, 0), textcoords="offset points", fontsize=8, color=MUTED)  # fmt: skip
    low, high = scan.factor[0], scan.factor[-1]
    usual = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 10.0) if high > 2.0 else (0.8, 0.9, 1.0, 1.1, 1.25)
    ticks = [tick for tick in usual if low <= tick <= high]
    ax.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    ax.minorticks_off()
    ax.margins(y=0.1)
    low, high = ax.get_ylim()
    if high < 50.0 * low:  # less than two decades have too few ticks
        ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: spoken.count(value)))
    return ax
