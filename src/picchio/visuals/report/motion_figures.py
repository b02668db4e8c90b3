"""The pictures of motion records, each with words that say what it shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from picchio.campaign.channels import Channel, parse_channel
from picchio.core.arrays import FloatArray
from picchio.diagnosis.motion.conclude.holdout import residual_of
from picchio.diagnosis.motion.data.system import Group, Segment, System
from picchio.diagnosis.motion.fit.orders import order_spectrum
from picchio.diagnosis.motion.fit.state import State
from picchio.diagnosis.motion.residual import GroupResidual, MotionResidual, rms
from picchio.diagnosis.result import Diagnosis
from picchio.model.effects.registry import effect_class
from picchio.model.motion import TORQUE, WINDUP
from picchio.robot.units import SLIDING, JointUnits
from picchio.visuals.plots.diagnosis import (
    plot_left_over,
    plot_motion_scores,
    plot_overlay,
    plot_place,
    shown_unit,
    telling_window,
)
from picchio.visuals.plots.residual import bins_of, plot_clouds, plot_orders, plot_restoring
from picchio.visuals.plots.style import blank_figure, plain
from picchio.visuals.report.page import Picture, Pictures, capitalised, number, percent, words
from picchio.visuals.report.trace import Trace

_BINS = 20
_SHOWN = 8.0  # s that an overlay shows
_WORDS = {TORQUE: "torque", WINDUP: "link angle less motor angle"}


@dataclass(frozen=True, eq=False)
class View:
    """One channel of one record.

    Attributes:
        system: the record's equations.
        segment: the channel's.
        before: (m,) what the baseline leaves, SI.
        after: (m,) what the extended model leaves.
        noise: standard deviation of the noise, SI.
    """

    system: System
    segment: Segment
    before: FloatArray
    after: FloatArray
    noise: float

    @property
    def group(self) -> Group:
        """Kind and joint."""
        return self.segment.group

    @property
    def file(self) -> str:
        """The record's."""
        return self.system.logs[self.segment.record].file

    @property
    def time(self) -> FloatArray:
        """(m,) s."""
        return self.segment.samples / self.system.logs[self.segment.record].rate

    @property
    def measured(self) -> FloatArray:
        """(m,) SI."""
        return self.segment.measured

    @property
    def units(self) -> JointUnits:
        """How the joint's values are written."""
        return self.system.robot.tree.joints[self.group[1]].units

    @property
    def words(self) -> str:
        """For people."""
        kind = self.units.load_word if self.group[0] == TORQUE else _WORDS[self.group[0]]
        return f"{kind} of {self.group[1]}"

    @property
    def channel(self) -> Channel:
        """With a short name, to label axes with."""
        kind, joint = self.group
        unit = self.units.of({TORQUE: "N*m"}.get(kind, "rad"))
        name = f"{'torque' if kind == TORQUE else 'position'}.{joint}"
        short = f"link - motor, {joint}" if kind == WINDUP else f"{self.words.split()[0]}, {joint}"
        return replace(parse_channel(name, unit)[0], name=short)

    def motion(self, name: str) -> FloatArray:
        """(m,) a series of the nominal motion, SI.

        Args:
            name: angle, velocity, acceleration, or body: the torque that the gear carries.
        """
        nominal = self.system.predictors[self.segment.record].nominal
        return getattr(nominal, name)[self.group[1]][self.segment.samples]


def _telling(found: Sequence[View], view: View) -> tuple[str, FloatArray, list[View]]:
    """What of the motion the residual goes with most, in all records of a channel.

    Angle, velocity, acceleration and the torque that the gear carries are each cut into bins of
    as many samples; the one whose bins' means take most of the residual's power is told.

    Returns:
        its name, its values, and the views whose samples those are.
    """
    same = [v for v in found if v.group == view.group]
    left = np.concatenate([v.before for v in same])
    series = {name: np.concatenate([v.motion(name) for v in same]) for name in _OVER}

    def taken(name: str) -> float:
        bins = [left[mask] for mask in bins_of(series[name], _BINS)]
        return float(sum(part.size * part.mean() ** 2 for part in bins))

    best = max(series, key=taken)
    return best, series[best], same


def views(diagnosis: Diagnosis, which: str) -> list[View]:
    """What is left of every torque and twist of motion records, before and after.

    Args:
        diagnosis: of a campaign that has such records.
        which: the records "train", which were fitted to, or those "held_out".
    """
    details = diagnosis.details.get("motion", diagnosis).details
    system: System = details["systems"][which]
    before, after = (residual_of(system, details[key]) for key in ("baseline", "extended"))
    noise = {(row["record"], row["channel"]): row["noise"] for row in details[which]}
    return [
        View(system, s, before[s.rows], after[s.rows],
             noise[system.logs[s.record].file, ".".join(s.group)])
        for s in system.segments if s.group[0] in _WORDS
    ]  # fmt: skip


_NOMINAL = {
    TORQUE: "its masses fitted within their tolerance",
    WINDUP: "which takes the gear as rigid",
}
_CANDIDATES = 8
_PICTURED = 4  # steps of the search
_BEYOND = 1.5  # times the highest order that was found
# Of the motion: name for people, and unit of a joint that turns.
_OVER = {
    "angle": ("position", "rad"),
    "velocity": ("velocity", "rad/s"),
    "acceleration": ("acceleration", "rad/s²"),
    "body": ("torque that the gear carries", "N m"),
}
_READ = {
    "angle": "a wrong mass or counterweight is a curve, ripple are waves",
    "velocity": "dry friction is a step at zero, viscous friction or a delay a line",
    "acceleration": "a missing inertia is a line",
    "body": "a soft gear is a line, play a step",
}


class MotionFigures(Pictures):
    """Draws a diagnosis.

    Args:
        diagnosis: of motion records.
    """

    PREFIX = "k"

    def __init__(self, diagnosis: Diagnosis) -> None:
        self.diagnosis = diagnosis
        self.changed = bool(diagnosis.details["extended"].effects)
        self.train = views(diagnosis, "train")

    def _worst(self, found: Sequence[View]) -> list[View]:
        """The torque and the twist, if measured, that the baseline leaves most of over its noise.

        Joints with a cause, if there are any, come first.
        """
        explained = {c.target for c in self.diagnosis.causes}
        chosen = []
        for kind in (TORQUE, WINDUP):
            of = [v for v in found if v.group[0] == kind]
            of = [v for v in of if v.group[1] in explained] or of
            chosen += sorted(of, key=lambda v: -rms(v.before) / v.noise)[:1]
        return chosen

    def _overlay(
        self, view: View, simulated: dict[str, FloatArray], alt: str, caption: str
    ) -> Picture:
        """A channel and its simulations; of a long record what shows the error best."""
        window = None
        if view.time[-1] - view.time[0] > 1.5 * _SHOWN:
            even = np.arange(view.time[0], view.time[-1], float(np.diff(view.time).min()))
            window = telling_window(even, np.interp(even, view.time, view.before), _SHOWN)
        ax = plot_overlay(view.time, view.measured, simulated, view.channel,
                          blank_figure(9.0, 3.0), window=window)  # fmt: skip
        return self.picture(ax, f"{view.words} as measured{alt}", caption)

    def wrong(self) -> list[Picture]:
        """The wrong simulation over the measurement, and what it leaves."""
        made = []
        for view in self._worst(self.train):
            missed = percent(rms(view.before) / rms(view.measured))
            caption = (
                f"{capitalised(view.words)} in {view.file}: the nominal model, "
                f"{_NOMINAL[view.group[0]]}. It misses {missed} % of the signal, "
                f"{number(rms(view.before) / view.noise, 3)} times the noise."
            )
            simulated = {"simulated": view.measured - view.before}
            made.append(self._overlay(view, simulated, " and as simulated", caption))
            after = view.after / view.noise if self.changed else None
            ax = plot_left_over(view.time, view.before / view.noise, after, blank_figure(9.0, 2.4))
            caption = "What is left of it, in standard deviations of its noise"
            if after is not None:
                caption += f"; after, {number(rms(after), 3)} times the noise are left"
            alt = f"what the simulation leaves of the {view.words}"
            made.append(self.picture(ax, alt, f"{caption}."))
        return made

    def traces(self) -> list[Trace]:
        """Every torque and twist of every record, the one that is missed most first."""
        held = views(self.diagnosis, "held_out") if "held_out" in self.diagnosis.details else []
        made: dict[tuple[str, str], Trace] = {}
        every = [(v, "") for v in self.train] + [(v, ", held out") for v in held]
        for view, told in sorted(every, key=lambda each: -rms(each[0].before) / each[0].noise):
            lines = {"measured": view.measured, "before": view.measured - view.before}
            if self.changed:
                lines["after"] = view.measured - view.after
            key = view.file, view.words
            made.setdefault(
                key, Trace(view.file + told, view.words, view.channel.unit, view.time, lines)
            )
        return list(made.values())

    def clouds(self) -> list[Picture]:
        """The residual over what of the motion it goes with most, and over the order."""
        made = []
        for view in self._worst(self.train):
            name, x, same = _telling(self.train, view)
            scale, unit = shown_unit(view.channel)
            before = scale * np.concatenate([v.before for v in same])
            after = scale * np.concatenate([v.after for v in same]) if self.changed else None
            over, per = _OVER[name]
            ax = plot_clouds(x, before, after,
                             f"{over} of {view.group[1]} [{view.units.of(per)}]",
                             f"left of the {view.words.split()[0]}\n[{unit.replace('*', ' ')}]",
                             blank_figure(5.2, 3.2))  # fmt: skip
            caption = (
                f"{capitalised(view.words)}, all fitted records: what is left goes with the {over} "
                f"more than with anything else of the motion ({_READ[name]})."
            )
            alt = f"What is left of the {view.words} over the {over}"
            made.append(self.picture(ax, alt, caption))
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
        bare = replace(state, effects=tuple(e for e in state.effects if not e.periodic))
        before, after = (
            order_spectrum(system, residual_of(system, s), joint, state) for s in (bare, state)
        )  # fmt: skip
        if before is None or after is None:
            return []
        units, found = system.robot.tree.joints[joint].units, np.array(sorted(ripples[joint]))
        scale, per = 1.0 / before.ratio, "turn of the motor" if before.ratio != 1.0 else ""
        if units is SLIDING:  # phase by metre, where a turning joint has phase by turn
            scale, per, found = 1.0 / (2.0 * np.pi), "metre", found * before.ratio / (2.0 * np.pi)
        per = per or "turn of the joint"
        shown = scale * before.orders <= _BEYOND * found.max()
        ax = plot_orders((scale * before.orders)[shown], before.strength[shown],
                         after.strength[shown], found.tolist(), blank_figure(5.2, 3.2),
                         per=per)  # fmt: skip
        orders = ", ".join(f"{order:.4g}" for order in found)
        if units is SLIDING:
            orders = ", ".join(f"every {1e3 / cycles:.4g} mm" for cycles in found)
        caption = (
            f"{joint}, {units.load_word} before and after its ripples were taken into account, by "
            f"cycles a {per}; found, not given: {orders}."
        )
        return [self.picture(ax, f"Residual of {joint} by order, with {orders} found", caption)]

    def held_out(self) -> list[Picture]:
        """Before and after in a record that neither model was fitted to."""
        gain = self.diagnosis.gain
        if gain is None or not self.changed or not gain.held_out_records:
            return []
        made = []
        for view in self._worst(views(self.diagnosis, "held_out")):
            simulated = {"before": view.measured - view.before, "after": view.measured - view.after}
            was, now = (rms(x) / rms(view.measured) for x in (view.before, view.after))
            caption = (
                f"{capitalised(view.words)} in {view.file}, which neither model has seen: the "
                f"error falls from {percent(was)} % of the signal to {percent(now)} %."
            )
            made.append(self._overlay(view, simulated, ", before and after", caption))
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
                                    chosen=step["accepted"])  # fmt: skip
            taken = len(step["accepted"])
            what = {0: "nothing could be added", 1: "one was added"}.get(taken, f"{taken} added")
            more = ", at most one for each set of equations" if taken > 1 else ""
            caption = f"Step {count + 1} of those that added something: {what}{more}."
            made.append(self.picture(ax, f"Candidates of step {count + 1} of the search", caption))
        return made

    def place(self) -> Picture:
        """The causes on the robot, at the pose in which the first fitted record begins."""
        system: System = self.diagnosis.details["systems"]["train"]
        robot = system.robot
        by: dict[str, list[str]] = {}
        for cause in self.diagnosis.causes:
            by.setdefault(cause.target, []).append(cause.effect)
        groups = {group for log in system.logs for group in log.group.values()}
        groups |= {TORQUE, "position", "motor_position"}
        drawn = sorted(target for target in by if target not in groups)
        angle = system.predictors[0].nominal.angle
        pose = np.array([float(angle[j][0]) if j in angle else 0.0 for j in robot.joint_names])
        alone = len(drawn) == 1 and len(set(by[drawn[0]])) == 1
        ax = plot_place(robot, pose, [(by[t][0], t) for t in drawn], blank_figure(3.7, 3.9),
                        labels=[words(by[t][0]) if alone else t for t in drawn])  # fmt: skip
        elsewhere = [target for target in by if target in groups]
        said = f"; {', '.join(elsewhere)}: in the readings, not in the robot" if elsewhere else ""
        caption = f"Where causes sit, the robot as {system.logs[0].file} begins{said}."
        return self.picture(ax, f"The robot from the side, with {', '.join(drawn)} marked", caption)


@dataclass(eq=False)
class MotionResidualFigures(Pictures):
    """Draws what a baseline leaves.

    Args:
        left: what the nominal model leaves.
    """

    PREFIX = "m"
    left: MotionResidual

    def section(self, group: GroupResidual) -> tuple[str, Picture, list[Picture]]:
        """A heading, a torque or twist over time, and what is left of it over the motion."""
        residual = self.left.fit.residual
        views = [
            View(self.left.system, s, residual[s.rows], residual[s.rows], group.noise)
            for s in self.left.system.of(group.group)
        ]
        view = max(views, key=lambda v: rms(v.before))
        share = percent(rms(view.before) / rms(view.measured))
        caption = f"In {view.file}, the record that shows most; {share} % is left."
        simulated = {"simulated": view.measured - view.before}
        ax = plot_overlay(view.time, view.measured, simulated, view.channel,
                          blank_figure(9.0, 2.7))  # fmt: skip
        over = self.picture(ax, f"{view.words} as measured and as simulated", caption)
        return capitalised(view.words), over, self._clouds(views)

    def _clouds(self, views: Sequence[View]) -> list[Picture]:
        """What is left of all records over position, velocity or torque."""
        view, joint = views[0], views[0].group[1]
        scale, unit = shown_unit(view.channel)
        left = scale * np.concatenate([v.before for v in views])
        made = []
        torque = view.group[0] == TORQUE
        for over in ("angle", "velocity") if torque else ("velocity", "body"):
            name = {"angle": "position", "body": "torque"}.get(over, over)
            x = np.concatenate([v.motion(over) for v in views]) * (1e-3 if over == "body" else 1.0)
            ax = plot_restoring(x, left, joint, blank_figure(5.2, 3.0), over=name,
                                prismatic=view.units is SLIDING)  # fmt: skip
            if over == "body":
                ax.set_xlabel(f"{view.units.load_word} that {plain(joint)} carries "
                              f"[{view.units.load}]")  # fmt: skip
            if not torque:
                ax.set_ylabel(f"left of the angle [{unit}]")
            hint = ": a soft gear is a line, play a step" if over == "body" else ""
            made.append(self.picture(ax, f"What is left of the {view.words} over the {name}",
                                     f"Over the {name}, all records{hint}."))  # fmt: skip
        return made
