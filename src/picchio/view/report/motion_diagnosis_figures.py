"""The pictures of a diagnosis of motion records, each with words that say what it shows."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes

from picchio.core.arrays import FloatArray
from picchio.diagnosis.motion.order_spectrum import order_spectrum
from picchio.diagnosis.motion.state import State
from picchio.diagnosis.motion.system import System
from picchio.diagnosis.result import Diagnosis
from picchio.model.motion import TORQUE, WINDUP
from picchio.view.plots.diagnosis import (
    plot_left_over,
    plot_overlay,
    shown_unit,
    telling_window,
)
from picchio.view.plots.diagnosis_place import plot_place
from picchio.view.plots.style import blank_figure
from picchio.view.report.diagnosis_figures import Picture
from picchio.view.report.motion_diagnosis_plots import (
    mark_places,
    plot_clouds,
    plot_motion_scores,
    plot_orders,
)
from picchio.view.report.motion_diagnosis_views import View, rms, telling, views, worst
from picchio.view.report.page import number, percent, themed_svg

_NOMINAL = {
    TORQUE: "its masses fitted within their tolerance",
    WINDUP: "which takes the gear as rigid",
}
_RIPPLE = "torque_ripple"
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
            if cause.effect == _RIPPLE:
                ripples.setdefault(cause.target, []).append(cause.parameters["order"].value)
        if not ripples:
            return []
        joint = max(ripples, key=lambda name: len(ripples[name]))
        system: System = self.diagnosis.details["systems"]["train"]
        state: State = self.diagnosis.details["extended"]
        still = tuple(e for e in state.effects if e.name != _RIPPLE)
        bare = State(state.nuisances, still, state.scales, state.tolerance, state.fixed)
        before, after = (
            order_spectrum(system, _left(system, s), joint, state) for s in (bare, state)
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

    def unseen(self) -> list[Picture]:
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


def _left(system: System, state: State) -> FloatArray:
    return system.measured - system.predict(state.every, state.scales)
