"""The pictures of a diagnosis of motion records, each with words that say what it shows."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes

from picchio.core.arrays import FloatArray
from picchio.diagnosis.motion.conclude.holdout import residual_of
from picchio.diagnosis.motion.data.system import System
from picchio.diagnosis.motion.fit.orders import order_spectrum
from picchio.diagnosis.motion.fit.state import State
from picchio.diagnosis.result import Diagnosis
from picchio.model.effects.registry import effect_class
from picchio.model.motion import TORQUE, WINDUP
from picchio.visuals.plots.diagnosis import (
    AFTER,
    BEFORE,
    plain_numbers,
    plot_left_over,
    plot_overlay,
    plot_place,
    shown_unit,
    telling_window,
)
from picchio.visuals.plots.style import (
    BLUE,
    GREY,
    INK,
    MUTED,
    axes_or_new,
    blank_figure,
    plain,
    styled,
)
from picchio.visuals.report.diagnosis_figures import Picture
from picchio.visuals.report.motion_diagnosis_views import View, rms, telling, views, worst
from picchio.visuals.report.page import number, percent, themed_svg

# Plots that only a diagnosis of motion records has.

_MOST_DOTS = 600
_BINS = 25
_PLOTTED = 1500  # lines of a spectrum
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
    step = max(1, orders.size // _PLOTTED)
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


_NOMINAL = {
    TORQUE: "its masses fitted within their tolerance",
    WINDUP: "which takes the gear as rigid",
}
_CANDIDATES = 8
_PICTURED = 4  # steps of the search
_SHOWN = 8.0  # s that an overlay shows
_BEYOND = 1.5  # times the highest order that was found
# Of the motion: name for people, and unit, of a joint that turns and of one that slides.
_OVER = {
    "angle": ("position", "rad", "m"),
    "velocity": ("velocity", "rad/s", "m/s"),
    "acceleration": ("acceleration", "rad/s²", "m/s²"),
    "body": ("torque that the gear carries", "N m", "N"),
}
_READ = {
    "angle": "a wrong mass or counterweight is a curve, ripple are waves",
    "velocity": "dry friction is a step at zero, viscous friction or a delay a line",
    "acceleration": "a missing inertia is a line",
    "body": "a soft gear is a line, play a step",
}


class MotionFigures:
    """Draws a diagnosis.

    Args:
        diagnosis: of motion records.
    """

    def __init__(self, diagnosis: Diagnosis) -> None:
        self.diagnosis = diagnosis
        self.changed = bool(diagnosis.details["extended"].effects)
        self.claimed = {c.target for c in diagnosis.causes}
        self.train = views(diagnosis, "train")
        self.held_out = views(diagnosis, "held_out")
        self._made = 0

    def _picture(self, ax: Axes, alt: str, caption: str) -> Picture:
        self._made += 1
        return Picture(Markup(themed_svg(ax, alt, f"k{self._made}")), caption)

    def _worst(self, found: list[View]) -> list[View]:
        """One torque and one twist, as far as they were measured."""
        both = [worst(found, kind, self.claimed) for kind in (TORQUE, WINDUP)]
        return [view for view in both if view is not None]

    def wrong(self) -> list[Picture]:
        """The wrong simulation over the measurement, and what it leaves."""
        made = []
        for view in self._worst(self.train):
            ax = _overlay(view, {"simulated": view.measured - view.before})
            missed = percent(rms(view.before) / rms(view.measured))
            caption = (
                f"{_start(view.words)} in {view.file}: the nominal model, "
                f"{_NOMINAL[view.group[0]]}. It misses {missed} % of the signal, "
                f"{number(rms(view.before) / view.noise, 3)} times the noise."
            )
            alt = f"{view.words} as measured and as simulated"
            made.append(self._picture(ax, alt, caption))
            ax = plot_left_over(view.time, view.before / view.noise,
                                view.after / view.noise if self.changed else None,
                                blank_figure(9.0, 2.4))  # fmt: skip
            then = f"; after, {number(rms(view.after) / view.noise, 3)} times the noise are left"
            caption = "What is left of it, in standard deviations of its noise"
            caption += f"{then if self.changed else ''}."
            alt = f"what the simulation leaves of the {view.words}"
            made.append(self._picture(ax, alt, caption))
        return made

    def clouds(self) -> list[Picture]:
        """The residual over what of the motion it goes with most, and over the order."""
        made = []
        for view in self._worst(self.train):
            name, x, same = telling(self.train, view)
            before = np.concatenate([v.before for v in same])
            after = np.concatenate([v.after for v in same]) if self.changed else None
            over, turning, sliding = _OVER[name]
            x_unit = sliding if view.prismatic else turning
            scale, unit = shown_unit(view.channel)
            ax = plot_clouds(x, scale * before, None if after is None else scale * after,
                             f"{over} of {view.group[1]} [{x_unit}]",
                             f"left of the {view.words.split()[0]}\n[{unit.replace('*', ' ')}]",
                             blank_figure(5.2, 3.2))  # fmt: skip
            caption = (
                f"{_start(view.words)}, all fitted records: what is left goes with the {over} "
                f"more than with anything else of the motion ({_READ[name]})."
            )
            alt = f"What is left of the {view.words} over the {over}"
            made.append(self._picture(ax, alt, caption))
        return made + self._orders()

    def _orders(self) -> list[Picture]:
        """The order spectrum of the joint with the most telling ripple."""
        ripples: dict[str, list[float]] = {}
        for cause in self.diagnosis.causes:
            if effect_class(cause.effect).periodic:
                ripples.setdefault(cause.target, []).append(cause.parameters["order"].value)
        if not ripples:
            return []
        joint = max(ripples, key=lambda name: len(ripples[name]))
        system: System = self.diagnosis.details["systems"]["train"]
        state: State = self.diagnosis.details["extended"]
        still = tuple(e for e in state.effects if not e.periodic)
        bare = State(state.nuisances, still, state.scales, state.tolerance, state.fixed)
        before, after = (
            order_spectrum(system, residual_of(system, s), joint, state) for s in (bare, state)
        )  # fmt: skip
        if before is None or after is None:
            return []
        geared = before.ratio != 1.0
        shown = before.orders / before.ratio <= _BEYOND * max(ripples[joint])
        ax = plot_orders(
            (before.orders / before.ratio)[shown], before.strength[shown], after.strength[shown],
            ripples[joint], blank_figure(5.2, 3.2), geared=geared,
        )  # fmt: skip
        orders = ", ".join(f"{order:.4g}" for order in sorted(ripples[joint]))
        length = "turn of the motor" if geared else "turn of the joint (2π m of a slide)"
        caption = (
            f"{joint}, torque before and after its ripples were taken into account, by cycles a "
            f"{length}; found, not given: {orders}."
        )
        return [self._picture(ax, f"Residual of {joint} by order, with {orders} found", caption)]

    def unfitted(self) -> list[Picture]:
        """Before and after in a record that neither model was fitted to."""
        gain = self.diagnosis.gain
        if gain is None or not self.changed or gain.held_out_records == gain.train_records:
            return []
        made = []
        for view in self._worst(self.held_out):
            simulated = {"before": view.measured - view.before, "after": view.measured - view.after}
            ax = _overlay(view, simulated)
            was, now = (rms(x) / rms(view.measured) for x in (view.before, view.after))
            caption = (
                f"{_start(view.words)} in {view.file}, which neither model has seen: the error "
                f"falls from {percent(was)} % of the signal to {percent(now)} %."
            )
            alt = f"{view.words} as measured, before and after"
            made.append(self._picture(ax, alt, caption))
        return made

    def scores(self) -> list[Picture]:
        """The candidates at the first steps of the search that added something."""
        made = []
        steps = [s for s in self.diagnosis.details["steps"] if s["scores"]]
        adding = [s for s in steps if s["accepted"]] or steps[:1]
        for count, step in enumerate(adding[:_PICTURED]):
            best: dict[tuple[str, str, float], dict[str, object]] = {}
            for row in step["scores"]:
                order = round(row["parameters"].get("order", 0.0), 1)
                best.setdefault((row["effect"], row["target"], order), row)
            rows = list(best.values())[:_CANDIDATES]
            ax = plot_motion_scores(rows, blank_figure(9.0, 1.0 + 0.27 * len(rows)),
                                    accepted=step["accepted"])  # fmt: skip
            taken = len(step["accepted"])
            what = {0: "nothing could be added", 1: "one was added"}.get(taken, f"{taken} added")
            more = ", at most one for each set of equations" if taken > 1 else ""
            caption = f"Step {count + 1} of those that added something: {what}{more}."
            alt = f"Candidates of step {count + 1} of the search"
            made.append(self._picture(ax, alt, caption))
        return made

    def place(self) -> Picture:
        """The causes on the robot, at the pose in which the first fitted record begins."""
        system: System = self.diagnosis.details["systems"]["train"]
        robot = system.robot
        by: dict[str, list[str]] = {}
        for cause in self.diagnosis.causes:
            words = cause.effect.replace("_", " ")
            known = by.setdefault(cause.target, [])
            if words not in known:
                known.append(words)
        groups = {group for log in system.logs for group in log.group.values()}
        groups |= {TORQUE, "position", "motor_position"}
        drawn = sorted(target for target in by if target not in groups)
        first = {c.target: c.effect for c in reversed(self.diagnosis.causes)}
        angle = system.predictors[0].nominal.angle
        pose = np.array([float(angle[j][0]) if j in angle else 0.0 for j in robot.joint_names])
        ax = plot_place(robot, pose, [(first[t], t) for t in drawn], blank_figure(3.7, 3.9))
        mark_places(ax, [
            by[t][0] if len(by[t]) == 1 and len(drawn) == 1 else t for t in drawn
        ])  # fmt: skip
        elsewhere = [target for target in by if target in groups]
        said = f"; {', '.join(elsewhere)}: in the readings, not in the robot" if elsewhere else ""
        caption = f"Where causes sit, the robot as {system.logs[0].file} begins{said}."
        alt = f"The robot from the side, with {', '.join(drawn)} marked"
        return self._picture(ax, alt, caption)


def _overlay(view: View, simulated: dict[str, FloatArray]) -> Axes:
    return plot_overlay(view.time, view.measured, simulated, view.channel, blank_figure(9.0, 3.0),
                        window=_window(view))  # fmt: skip


def _window(view: View) -> tuple[float, float] | None:
    """The stretch of a long record that shows the error best, s."""
    if view.time[-1] - view.time[0] <= 1.5 * _SHOWN:
        return None
    even = np.arange(view.time[0], view.time[-1], float(np.diff(view.time).min()))
    return telling_window(even, np.interp(even, view.time, view.before), _SHOWN)


def _start(text: str) -> str:
    """With a capital, and names as they are."""
    return text[:1].upper() + text[1:]
