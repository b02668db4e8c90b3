"""A diagnosis: causes on the robot, curves before and after, candidates' scores, residual bands."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.patheffects import withStroke
from numpy.typing import ArrayLike

from picchio.campaign.channels import Channel
from picchio.core.arrays import FloatArray
from picchio.diagnosis.percussion.criteria.whiteness import Level
from picchio.model.effects.registry import effect_class
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.visuals.kinematics import Frame, frames, world
from picchio.visuals.plots.style import (
    BLUE,
    GREY,
    INK,
    MUTED,
    PAPER,
    VERMILION,
    axes_or_new,
    plain,
    styled,
)

BEFORE: dict[str, Any] = {"color": VERMILION, "linestyle": (0, (5, 1.6))}
AFTER: dict[str, Any] = {"color": BLUE, "linestyle": "-"}
MEASURED: dict[str, Any] = {"color": INK, "linewidth": 2.6, "alpha": 0.35}
# Standard deviations of the noise that hold 95 % of it.
_BAND = 1.96
_SHOWN = {"rad": (1e3, "mrad"), "m": (1e3, "mm"), "m/s": (1e3, "mm/s")}
_LOWEST = 0.5
_MOST_LABELS = 5
_LONG = 12  # letters of a label


def place_in_words(robot: FlexibleRobot, effect: str, target: str) -> str:
    """Where on the robot an effect sits, as a phrase."""
    kind = effect_class(effect).target_kind
    names = robot.flexible_names
    if target in names:
        count = len(names)
        return f"in {target}, flexible joint {names.index(target) + 1} of {count} from the base"
    if kind == "axis":
        turn = target.startswith("r")
        return f"under the base, {'about' if turn else 'along'} {target[-1]}"
    if kind == "tool":
        return f"at the tool ({robot.tool_frame})"
    if kind == "robot":
        return "in the whole arm"
    if kind == "channel group":
        return f"in the channels {target}, not in the robot"
    return f"at {target}"


@styled
def plot_place(
    robot: FlexibleRobot,
    pose: FloatArray,
    causes: Sequence[tuple[str, str]],
    ax: Axes | None = None,
    *,
    direction: ArrayLike | None = None,
    labels: Sequence[str] = (),
) -> Axes:
    """The robot at a pose, seen from the side it spreads most, with the causes' places ringed.

    Args:
        robot: the robot.
        pose: (nv,) rad or m.
        causes: (effect, target).
        ax: where to draw.
        direction: (3,) of the blows, drawn at the tool.
        labels: what is written beside each cause's ring; the effect's name if not given. Rings
            that lie on each other share a text.
    """
    ax = axes_or_new(ax)
    all_frames = frames(robot, pose)
    at = {link: matrix[:3, 3] for link, matrix in world(all_frames).items()}
    sideways = _sideways(np.array(list(at.values())))

    def seen(point: FloatArray) -> tuple[float, float]:
        return float(point @ sideways), float(point[2])

    for parent, frame in _bones(all_frames):
        ends = np.transpose([seen(at[parent]), seen(at[frame.link])])
        ax.plot(*ends, color=MUTED, linewidth=5.0, alpha=0.55, solid_capstyle="round", zorder=1)
    for frame in all_frames:
        if frame.joint in robot.flexible_names:
            ax.plot(*seen(at[frame.link]), "o", color=PAPER, markeredgecolor=INK, markersize=7,
                    markeredgewidth=1.4, zorder=3)  # fmt: skip
    ax.plot(*seen(at[all_frames[0].link]), "s", color=MUTED, markersize=9, zorder=2)
    tip = at[robot.link_of(robot.tool_frame)]
    ax.plot(*seen(tip), ">", color=INK, markersize=6, zorder=3)
    size = max(np.ptp([seen(p) for p in at.values()], axis=0).max(), 1e-3)
    if direction is not None:
        unit = np.asarray(direction, dtype=float)
        x, z = seen(tip)
        dx, dz = seen(0.22 * size * unit / np.linalg.norm(unit))
        ax.annotate("", (x, z), xytext=(x - dx, z - dz), zorder=2,
                    arrowprops={"arrowstyle": "-|>", "color": BLUE, "linewidth": 1.6})  # fmt: skip
    across = [seen(p)[0] for p in at.values()]
    names = [effect.replace("_", " ") for effect, _ in causes]
    marked: list[tuple[tuple[float, float], list[str]]] = []
    for (effect, target), label in zip(causes, labels or names, strict=True):
        points = [seen(point) for point in _points(robot, effect, target, all_frames, at)]
        for point in points:
            ax.plot(*point, "o", color="none", markeredgecolor=VERMILION, markersize=19,
                    markeredgewidth=2.4, zorder=4)  # fmt: skip
        if points:
            x, z = points[-1]
            near = [text for (a, b), text in marked if abs(x - a) + abs(z - b) < 0.12 * size]
            near[0].append(label) if near else marked.append((points[-1], [label]))
    for (x, z), texts in marked:
        told = [plain(text, 24) for text in texts[:_MOST_LABELS]]
        told += ["\N{HORIZONTAL ELLIPSIS}"] * (len(texts) > _MOST_LABELS)
        # On the side where there is room for it: a short name has room right of the middle, too.
        share = 0.6 if max(map(len, texts)) < _LONG else 0.5
        side = 1 if x <= min(across) + share * np.ptp(across) else -1
        ax.annotate("\n".join(told), (x, z), xytext=(15 * side, 9), textcoords="offset points",
                    ha="left" if side > 0 else "right", color=VERMILION, fontsize=9,
                    fontweight="bold", zorder=5,
                    path_effects=[withStroke(linewidth=3.0, foreground=PAPER)])  # fmt: skip
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.22)
    ax.grid(False)
    ax.set(xlabel="sideways [m]", ylabel="height [m]")
    return ax


def _sideways(points: FloatArray) -> FloatArray:
    """(3,) horizontal unit vector along which the points spread most."""
    flat = points[:, :2] - points[:, :2].mean(axis=0)
    axis = np.linalg.svd(flat)[2][0]
    axis = axis if axis[np.argmax(np.abs(axis))] > 0 else -axis
    return np.array([axis[0], axis[1], 0.0])


def _bones(all_frames: Sequence[Frame]) -> list[tuple[str, Frame]]:
    links = {frame.path: frame.link for frame in all_frames}
    parents = [(links.get(frame.path.rpartition("/")[0]), frame) for frame in all_frames]
    return [(parent, frame) for parent, frame in parents if parent is not None]


def _points(
    robot: FlexibleRobot,
    effect: str,
    target: str,
    all_frames: Sequence[Frame],
    at: dict[str, FloatArray],
) -> list[FloatArray]:
    """World positions that an effect's target stands for."""
    kind = effect_class(effect).target_kind
    joints = [at[f.link] for f in all_frames if f.joint in robot.flexible_names]
    tip = at[robot.link_of(robot.tool_frame)]
    for frame in all_frames:
        if frame.joint == target:
            return [at[frame.link]]
    if target in at and kind != "tool":
        below = [at[frame.link] for parent, frame in _bones(all_frames) if parent == target]
        return [0.5 * (at[target] + below[0])] if below else [at[target]]
    if kind == "axis":
        return [at[all_frames[0].link]]
    if kind == "robot" or target == "deflection":
        return joints
    if kind == "channel group":
        return [at.get(target.partition(".")[2], tip)]
    return [tip]


def shown_unit(channel: Channel) -> tuple[float, str]:
    """The factor and the unit that a channel is drawn in."""
    return _SHOWN.get(channel.unit, (1.0, channel.unit))


def telling_window(time: FloatArray, difference: FloatArray, length: float) -> tuple[float, float]:
    """The stretch of a record where two curves differ most, s.

    Args:
        time: (m,) s, uniform.
        difference: (m,) between the two.
        length: s, of the stretch.
    """
    first = int(np.searchsorted(time, -1e-9))
    time, square = time[first:], np.asarray(difference)[first:] ** 2
    step = float(time[1] - time[0])
    count = min(max(int(length / step), 2), time.size)
    sums = np.concatenate([[0.0], np.cumsum(square)])
    start = int(np.argmax(sums[count:] - sums[:-count]))
    return float(time[start]), float(time[start + count - 1])


@styled
def plot_overlay(
    time: ArrayLike,
    measured: ArrayLike,
    simulated: Mapping[str, ArrayLike],
    channel: Channel,
    ax: Axes | None = None,
    *,
    window: tuple[float, float] | None = None,
) -> Axes:
    """A channel as measured, with one or two simulations over it.

    Args:
        time: (m,) s.
        measured: (m,) SI.
        simulated: {label: (m,)}; the first is drawn as the one before, the second as after.
        channel: what it measures.
        ax: where to draw.
        window: s, from and to; all of it where None.
    """
    ax = axes_or_new(ax)
    scale, unit = shown_unit(channel)
    t = np.asarray(time)
    low, high = window or (float(t[0]), float(t[-1]))
    inside = (t >= low - 1e-12) & (t <= high + 1e-12)
    ax.plot(t[inside], scale * np.asarray(measured)[inside], label="measured", **MEASURED)
    for style, (label, values) in zip((BEFORE, AFTER), simulated.items(), strict=False):
        ax.plot(t[inside], scale * np.asarray(values)[inside], label=label, linewidth=1.3, **style)
    ax.set(xlabel="time [s]", ylabel=f"{plain(channel.name)}\n[{unit}]")
    ax.set_xlim(low, high)
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    return ax


@styled
def plot_left_over(
    time: ArrayLike,
    before: ArrayLike | None,
    after: ArrayLike | None = None,
    ax: Axes | None = None,
    *,
    blows: ArrayLike = (),
) -> Axes:
    """What a simulation leaves, in units of the noise, with the band that noise keeps to.

    Args:
        time: (m,) s.
        before: (m,) whitened residual; None to draw `after` alone, on its own scale.
        after: (m,) of the better model.
        ax: where to draw.
        blows: s, when each blow begins.
    """
    ax = axes_or_new(ax)
    t = np.asarray(time)
    starts = np.asarray(blows, dtype=float)
    if starts.size:
        ax.plot(starts, np.zeros(starts.size), "|", color=MUTED, markersize=9, zorder=0.5,
                transform=ax.get_xaxis_transform(), clip_on=False, label="blows")  # fmt: skip
    if before is not None:
        ax.plot(t, np.asarray(before), label="before" if after is not None else "residual",
                linewidth=1.0, color=BEFORE["color"])  # fmt: skip
    if after is not None:
        ax.plot(t, np.asarray(after), label="after", linewidth=0.8, color=AFTER["color"])
    ax.axhspan(-_BAND, _BAND, color=MUTED, alpha=0.28, linewidth=0, label="95 % of noise")
    ax.set(xlabel="time [s]", ylabel="residual\n[noise std]")
    ax.set_xlim(float(t[0]), float(t[-1]))
    if before is None:
        most = max(5.0, 1.1 * float(np.abs(np.asarray(after)).max()))
        ax.set_ylim(-most, most)
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4)
    return ax


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
        chosen: (effect, target) of the final causes.
    """
    ax = axes_or_new(ax)
    rows = sorted(scores, key=lambda row: (row["bic"], row["chi_square_per_sample"]))
    left = [math.sqrt(max(row["chi_square_per_sample"], 1e-6)) for row in rows]
    start = math.sqrt(max(without[1], 1e-6))
    low, high = 0.6 * min(1.0, *left), max(start, *left, 1.3)
    stand = _candidates(ax, rows, chosen, [value - low for value in left], low)
    for place, (row, value, stands) in enumerate(zip(rows, left, stand, strict=True)):
        fall = without[0] - row["bic"]
        if not math.isfinite(fall):
            note = "far behind early on: dropped"
        elif fall <= 0.0:
            note = "does not pay for its numbers"
        else:
            note = f"evidence {fall:,.0f}"
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
    plain_numbers(ax.xaxis, low, high)
    ax.set(xlabel="residual that is left once fitted [× noise, RMS]")
    return ax


@styled
def plot_motion_scores(
    scores: Sequence[Mapping[str, Any]],
    ax: Axes | None = None,
    *,
    chosen: Collection[tuple[str, str]] = (),
) -> Axes:
    """What each candidate takes of the residual on stretches that it was not fitted to.

    Args:
        scores: of one step of the search: dicts with effect, target, share, rank; best first.
        ax: where to draw.
        chosen: (effect, target) of those that were added.
    """
    ax = axes_or_new(ax)
    shares = [100.0 * max(row["share"], 0.0) for row in scores]
    stand = _candidates(ax, scores, chosen, shares)
    for place, (row, share, stands) in enumerate(zip(scores, shares, stand, strict=True)):
        note = f"{share:.3g} %; evidence {row['rank']:,.0f}".replace("-", "\N{MINUS SIGN}")
        ax.text(share + 1.2, place, note, va="center", fontsize=8, color=INK if stands else MUTED)
    ax.set_xlim(0.0, 128.0)
    ax.set_xticks(range(0, 101, 20))
    ax.set(xlabel="share of what is left in its channels that it takes, on stretches held out [%]")
    return ax


def _candidates(
    ax: Axes,
    rows: Sequence[Mapping[str, Any]],
    chosen: Collection[tuple[str, str]],
    lengths: Sequence[float],
    start: float = 0.0,
) -> list[bool]:
    """A bar for each candidate, down the vertical axis, those chosen in bold; which these are."""
    stand = [(row["effect"], row["target"]) in chosen for row in rows]
    names = []
    for place, (row, length, stands) in enumerate(zip(rows, lengths, stand, strict=True)):
        ax.barh(place, length, left=start, height=0.62, color=BLUE if stands else GREY,
                alpha=1.0 if stands else 0.6)  # fmt: skip
        order = row.get("parameters", {}).get("order")
        name = f"{row['effect'].replace('_', ' ')}, {row['target']}"
        names.append(plain(name if order is None else f"{name}, order {order:.4g}", 44))
    ax.set_ylim(len(rows) - 0.4, -0.6)
    ax.grid(False, axis="y")
    ax.set_yticks(range(len(rows)), names)
    for label, stands in zip(ax.get_yticklabels(), stand, strict=True):
        if stands:
            label.set_fontweight("bold")
    return stand


def plain_numbers(axis: Axis, low: float, high: float) -> None:
    """Ticks of a logarithmic axis as plain numbers where they are few and short."""
    from matplotlib.ticker import LogLocator, NullFormatter

    wide = high / low > 30.0
    axis.set_major_locator(LogLocator(subs=(1.0,) if wide else (1.0, 2.0, 5.0)))
    if high / low < 1e4:
        axis.set_major_formatter(lambda value, _: f"{value:g}")
    axis.set_minor_formatter(NullFormatter())


@styled
def plot_bands(
    before: Sequence[Level],
    after: Sequence[Level],
    ax: Axes | None = None,
    *,
    natural_frequencies: Iterable[float] = (),
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
        edges = [level.part.removesuffix(" Hz").split("-") for level in levels]
        x = np.array([[max(float(low), _LOWEST), float(high)] for low, high in edges]).ravel()
        y = np.repeat([max(level.power, 1e-3) for level in levels], 2)
        ax.plot(x, y, label=label, linewidth=1.8, **style)
    ax.axhline(1.0, color=MUTED, linewidth=1.2, label="noise")
    inside = [f for f in natural_frequencies if f >= _LOWEST]
    for k, frequency in enumerate(inside):
        ax.axvline(frequency, color=MUTED, linewidth=0.8, linestyle=":", zorder=0.5,
                   label="modes" if k == 0 else None)  # fmt: skip
    ax.set(xscale="log", yscale="log")
    low, high = ax.get_ylim()
    low, high = min(low, 0.5), max(high, 4.0)
    ax.set_ylim(low, high)
    plain_numbers(ax.yaxis, low, high)
    plain_numbers(ax.xaxis, *ax.get_xlim())
    ax.set(xlabel="frequency [Hz]", ylabel="power / noise's power")
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4)
    return ax
