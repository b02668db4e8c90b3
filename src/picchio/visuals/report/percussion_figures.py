"""The pictures of percussion records, each with words that say what it shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from picchio.campaign.channels import Channel
from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.diagnosis.percussion.criteria.equivalence import bic
from picchio.diagnosis.percussion.data.problem import MeasuredRecord
from picchio.diagnosis.percussion.diagnosis import PercussionDiagnosis
from picchio.diagnosis.percussion.fit.least_squares import Fit
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.residual import (
    PercussionResidual,
    over_time,
    restoring,
    transfers,
)
from picchio.diagnosis.result import Diagnosis
from picchio.prediction.residual import together
from picchio.visuals.plots.diagnosis import (
    plot_bands,
    plot_left_over,
    plot_motion_scores,
    plot_overlay,
    plot_place,
    plot_scores,
    telling_window,
)
from picchio.visuals.plots.frequency import plot_transfer
from picchio.visuals.plots.residual import (
    plot_by_condition,
    plot_over_time,
    plot_residual_map,
    plot_residual_spectrum,
    plot_restoring,
)
from picchio.visuals.plots.style import blank_figure, direction_label
from picchio.visuals.report.page import Picture, Pictures, number, words
from picchio.visuals.report.trace import Trace

# Blow periods that an overlay shows.
_PERIODS = 10.0
_FEWEST_SECONDS = 0.15
# Candidates that a picture of a step shows; a wider search fits many more.
_SHOWN = 12


def plot_candidates(found: Diagnosis, ax: Axes | None = None, *, step: int | None = None) -> Axes:
    """What each candidate of a step of the search leaves, or takes of what is left.

    Args:
        found: the diagnosis.
        ax: where to draw.
        step: of the search, from 1; the first that compared candidates if not given.

    Raises:
        InputError: no such step.
    """
    step = step or min((row["step"] for row in found.scores), default=1)
    rows = [row for row in found.scores if row["step"] == step]
    if not rows:
        raise InputError(
            "no such step of the search",
            key="step",
            value=step,
            choices=sorted({row["step"] for row in found.scores}),
        )
    stand = [(cause.effect, cause.target) for cause in found.causes]
    if "screened_gain" not in rows[0]:
        return plot_motion_scores(rows[:_SHOWN], ax, chosen=stand)
    return plot_scores(rows[:_SHOWN], _without(found.details["percussion"]), ax, chosen=stand)


def _without(found: PercussionDiagnosis) -> tuple[float, float]:
    """BIC and chi-square per sample with no cause."""
    start = found.search.baseline
    return bic(start), start.chi_square / max(start.samples, 1)


@dataclass(frozen=True)
class View:
    """One channel of one record.

    Attributes:
        record: the record.
        index: its place among the records.
        channel: the channel.
        row: its place among the record's.
        times: residual's RMS over the noise.
    """

    record: MeasuredRecord
    index: int
    channel: Channel
    row: int
    times: float

    @property
    def time(self) -> FloatArray:
        """(m,) s."""
        return self.record.setup.samples.times

    @property
    def measured(self) -> FloatArray:
        """(m,) SI."""
        return self.record.values[self.channel.name]

    @property
    def where(self) -> str:
        """Record, pose and direction in words."""
        along = direction_label(self.record.setup.blows.direction)
        return f"{self.record.name}, pose {self.record.pose + 1}, blows along {along}"

    @property
    def blows(self) -> FloatArray:
        """(k,) s, where blows begin."""
        start = self.record.setup.blows.onsets
        return np.asarray(start[start <= self.time[-1]])

    def aligned(self, predictions: dict[str, FloatArray]) -> FloatArray:
        """(m,) SI, the channel as predicted, a free offset as the measurement's.

        Args:
            predictions: channel -> (m,) SI, of the record.
        """
        predicted = predictions[self.channel.name]
        if self.record.setup.steady or self.channel.kind.free_offset:
            predicted = predicted + float(np.mean(self.measured - predicted))
        return predicted


def worst_view(fit: Fit, names: tuple[str, ...] = ()) -> View:
    """The record and channel that a fit leaves most of, over the noise.

    Args:
        fit: with residuals of all its records.
        names: only records of these names; all if there are none of them.
    """
    known = {record.name for record in fit.records}
    chosen = known & set(names) or known
    found = [
        View(record, index, next(c for c in record.setup.channels if c.name == name), row,
             float(np.sqrt(np.mean(fit.residuals[index][row] ** 2))))
        for index, record in enumerate(fit.records) if record.name in chosen
        for row, name in enumerate(record.values)
    ]  # fmt: skip
    return max(found, key=lambda view: view.times)


class _Percussion(Pictures):
    """Pictures of the channel that a baseline leaves most of."""

    def __init__(self, baseline: Fit) -> None:
        self.baseline = baseline
        self.worst = worst_view(baseline)

    def _overlay(
        self, view: View, simulated: dict[str, FloatArray], shown: str, caption: str
    ) -> Picture:
        """A channel and its simulations, where the first of these is furthest away."""
        length = max(_PERIODS * view.record.setup.blows.interval, _FEWEST_SECONDS)
        difference = view.measured - next(iter(simulated.values()))
        window = telling_window(view.time, difference, length)
        ax = plot_overlay(view.time, view.measured, simulated, view.channel,
                          blank_figure(9.0, 3.0), window=window)  # fmt: skip
        start, end = window
        alt = f"{view.channel.name} as measured{shown}, from {start:.3g} to {end:.3g} seconds"
        return self.picture(ax, alt, f"{view.channel.name} in {view.where}{caption}")


class PercussionFigures(_Percussion):
    """Draws a diagnosis.

    Args:
        found: the diagnosis.
    """

    PREFIX = "d"

    def __init__(self, found: PercussionDiagnosis) -> None:
        super().__init__(found.baseline)
        self.found = found
        self.changed = bool(found.extended.hypothesis.labels)
        self.claimed = tuple((c.effect, c.target) for c in found.diagnosis.causes)

    def wrong(self) -> list[Picture]:
        """The simulation over the measurement, and what it leaves, before and after."""
        view = self.worst
        predicted = self._predict(self.baseline.hypothesis, view)
        caption = (
            ": the nominal model, stiffness, damping and force fitted within their tolerance. Its "
            f"residual is {view.times:.3g} times the noise (RMS), more than in any other channel."
        )
        made = [self._overlay(view, {"simulated": predicted}, " and as simulated", caption)]
        before = self.baseline.residuals[view.index][view.row]
        after = self.found.extended.residuals[view.index][view.row] if self.changed else None
        said = "what the simulation leaves of this channel, in standard deviations of its noise"
        ax = plot_left_over(view.time, before, after, blank_figure(9.0, 2.5), blows=view.blows)
        made.append(self.picture(ax, said, f"{said.capitalize()}."))
        if after is not None:
            ax = plot_left_over(view.time, None, after, blank_figure(9.0, 2.1), blows=view.blows)
            rms = float(np.sqrt(np.mean(after**2)))
            made.append(self.picture(ax, "the residual after, on its own scale",
                        f"After, on its own scale: {rms:.3g} times the noise (RMS)."))  # fmt: skip
        return made

    def traces(self) -> list[Trace]:
        """Every channel of every record, the one that the baseline leaves most of first."""
        problem = self.found.problem
        records = list(self.found.baseline.records)
        fits = {"simulated": self.found.baseline.hypothesis}
        if self.changed:
            fits = {"before": self.found.baseline.hypothesis,
                    "after": self.found.extended.hypothesis}  # fmt: skip
        predicted = {
            name: problem.predictions(hypothesis.effects, records)
            for name, hypothesis in fits.items()
        }
        views = [
            View(record, index, channel, row,
                 float(np.sqrt(np.mean(self.baseline.residuals[index][row] ** 2))))
            for index, record in enumerate(records)
            for row, name in enumerate(record.values)
            for channel in record.setup.channels if channel.name == name
        ]  # fmt: skip
        made = []
        for view in sorted(views, key=lambda view: -view.times):
            lines = {name: view.aligned(every[view.index]) for name, every in predicted.items()}
            made.append(Trace(view.record.name, view.channel.name, view.channel.unit, view.time,
                              {"measured": view.measured, **lines}))  # fmt: skip
        return made

    def held_out(self) -> list[Picture]:
        """Before and after in a record that neither model was fitted to."""
        gain = self.found.diagnosis.gain
        if gain is None or not gain.held_out_records or not self.changed:
            return []
        view = worst_view(self.baseline, gain.held_out_records)
        unseen = self.found.search.best.hypothesis
        latent = any(e.hidden for e in unseen.effects)
        simulated = {
            "before": self._predict(self.found.search.baseline.hypothesis, view),
            "after": self._predict(self.found.extended.hypothesis if latent else unseen, view),
        }
        fitted = ("fitted to this record too, since some numbers are drawn anew in each" if latent
                  else "neither model has seen this record")  # fmt: skip
        if gain.held_out_records == gain.train_records:
            fitted = "too few records to hold any out: this one was fitted"
        return [self._overlay(view, simulated, ", before and after", f"; {fitted}.")]

    def scores(self) -> list[Picture]:
        """The candidates, a picture a step of the search."""
        rows = list(self.found.diagnosis.scores)
        without = _without(self.found)
        stand = tuple(tuple(x.split(":", 1)) for x in self.found.extended.hypothesis.labels)
        made = []
        for step in sorted({row["step"] for row in rows}):
            tried = [row for row in rows if row["step"] == step]
            here = tried[:_SHOWN]  # the best come first
            ax = plot_scores(here, without, blank_figure(9.0, 1.0 + 0.27 * len(here)),
                             chosen=stand)  # type: ignore[arg-type]  # fmt: skip
            best = min(here, key=lambda row: row["bic"])
            named = [f"{words(row['effect'])} of {row['target']}" for row in (best, *here)]
            left = ", ".join(f"{name} {row['chi_square_per_sample'] ** 0.5:.3g}"
                             for name, row in zip(named[1:], here, strict=True))  # fmt: skip
            alt = f"Candidates of step {step} and what each leaves over the noise: {left}"
            kept = (best["effect"], best["target"]) in stand
            caption = f"Step {step} of the search: " + (
                f"{named[0]} does best." if kept else "nothing that could be kept."
            )
            if len(tried) > len(here):
                caption += f" {len(tried) - len(here)} more did no better."
            made.append(self.picture(ax, alt, caption))
            without = (best["bic"], best["chi_square_per_sample"])
        return made

    def bands(self) -> list[Picture]:
        """Power by frequency against the noise, a picture a channel group."""
        modes = self.found.problem.natural_frequencies[self.worst.record.pose]
        made = []
        groups = list(dict.fromkeys(level.group for level in self.found.before.bands))
        width = 5.2 if len(groups) > 1 else 9.4
        for group in groups:
            before = [x for x in self.found.before.bands if x.group == group]
            after = [x for x in self.found.after.bands if x.group == group and self.changed]
            ax = plot_bands(before, after, blank_figure(width, 3.0), natural_frequencies=modes)
            most = max(before, key=lambda level: level.power)
            made.append(self.picture(ax, f"Residual power of {group} by frequency",
                        f"{group}: most is left at {most.part}, {number(most.power, 3)} times "
                        "the noise's power."))  # fmt: skip
        return made

    def place(self) -> Picture:
        """The causes on the robot."""
        setup = self.worst.record.setup
        ax = plot_place(self.found.problem.robot, setup.geometry.pose, self.claimed,
                        blank_figure(3.7, 3.9), direction=setup.blows.direction)  # fmt: skip
        named = ", ".join(f"{e} at {t}" for e, t in self.claimed) or "nothing"
        return self.picture(ax, f"The robot from the side, with {named} marked",
                            f"The robot at pose {self.worst.record.pose + 1}; the arrow is "
                            "the tool's force.")  # fmt: skip

    def _predict(self, hypothesis: Hypothesis, view: View) -> FloatArray:
        """The channel as the hypothesis has it."""
        return view.aligned(self.found.problem.predictions(hypothesis.effects, [view.record])[0])


class PercussionResidualFigures(_Percussion):
    """Draws what a baseline leaves.

    Args:
        left: what the nominal model leaves.
    """

    PREFIX = "r"

    def __init__(self, left: PercussionResidual) -> None:
        super().__init__(left.fit)
        self.left = left
        self.groups = tuple(dict.fromkeys(p.group for p in left.parts))
        self.records = list(dict.fromkeys(p.record for p in left.parts))

    def wrong(self) -> list[Picture]:
        """Measured and simulated, and their difference, where it shows most."""
        view = self.worst
        simulated = {"simulated": view.aligned(self.left.predictions[view.index])}
        caption = ": where the simulation is furthest from the measurement, in units of its noise."
        made = [self._overlay(view, simulated, " and as simulated", caption)]
        ax = plot_left_over(view.time, self.baseline.residuals[view.index][view.row], None,
                            blank_figure(9.0, 2.4), blows=view.blows)  # fmt: skip
        made.append(self.picture(ax, "Residual of this channel over time",
                    f"What is left of it: {view.times:.3g} times the noise (RMS)."))  # fmt: skip
        return made

    def map(self) -> Picture:
        """Records by channels."""
        channels = list(dict.fromkeys(p.channel for p in self.left.parts))
        values = np.full((len(self.records), len(channels)), np.nan)
        for p in self.left.parts:
            values[self.records.index(p.record), channels.index(p.channel)] = p.times
        height = 1.3 + 0.2 * min(len(self.records), 60)
        ax = plot_residual_map(values, self.records, channels, blank_figure(9.0, height))
        return self.picture(ax, "Residual over noise of every record and channel",
                            "Residual over noise (RMS); 1 is noise. A bright column is a "
                            "channel that is wrong in all records, a bright row a "
                            "record.")  # fmt: skip

    def by_frequency(self) -> Picture:
        """Spectrum of all records together."""
        spectra = self.left.spectra
        ax = plot_residual_spectrum(spectra.edges, spectra.power, blank_figure(9.0, 3.4),
                                    modes=spectra.modes, hit_rate=spectra.hit_rate)  # fmt: skip
        group, at, power = spectra.worst
        return self.picture(ax, "Residual power by frequency",
                            f"Most is left of {group} near {at:.3g} Hz: {number(power, 3)} times "
                            "the noise's power. The bands are the nominal model's natural "
                            "frequencies over the poses.")  # fmt: skip

    def by_time(self) -> Picture:
        """Hit by hit."""
        found = over_time(self.baseline)
        ax = plot_over_time(found.edges, found.residual, found.signal, blank_figure(9.0, 3.0),
                            last_blow=found.last_blow)  # fmt: skip
        return self.picture(ax, "Residual hit by hit",
                            "All records together, a window a hit. Compare the residual with "
                            "the signal: does it grow from hit to hit, die out with the "
                            "vibration, or outlast it?")  # fmt: skip

    def by_condition(self) -> list[Picture]:
        """By pose, direction, level, temperature, date."""
        both = {
            g: [
                together(p for p in self.left.parts if (p.record, p.group) == (r, g))
                for r in self.records
            ]
            for g in self.groups
        }
        shares = {g: [one.nrmse for one in every] for g, every in both.items()}
        floors = {g: [one.floor for one in every] for g, every in both.items()}
        made = []
        for what, values in self._conditions().items():
            if len(set(values)) > 1:
                ax = plot_by_condition(values, shares, floors, what, blank_figure(5.2, 3.0))
                made.append(self.picture(ax, f"Residual over signal by {what}",
                                         f"By {what.partition(' [')[0]}."))  # fmt: skip
        return made

    def restoring(self) -> list[Picture]:
        """Missing torque over deflection and velocity, two pictures a joint."""
        kinds = {j.name: j.kind for j in self.left.problem.robot.flexible_joints}
        made = []
        found = restoring(self.left.problem, self.baseline, self.left.predictions)
        for name, (record, one) in found.items():
            for over, x in (("deflection", one.deflection), ("velocity", one.velocity)):
                ax = plot_restoring(x, one.torque, name, blank_figure(5.2, 3.0), over=over,
                                    prismatic=kinds[name] == "prismatic")  # fmt: skip
                made.append(self.picture(ax, f"Missing torque of {name} over its {over}",
                                         f"{name}, over its {over}, in {record}."))  # fmt: skip
        return made

    def transfers(self) -> tuple[str, list[Picture]]:
        """Frequency responses, and the names of the records that they are from."""
        records, found = transfers(self.baseline, self.left.predictions)
        made = []
        highest = 2.0 * max(high for _, high in self.left.spectra.modes)
        for name, one in found.items():
            channel = self.left.problem.campaign[records[0].name].channel(name)
            ax = plot_transfer(one, channel, blank_figure(5.2, 3.2), highest=highest)
            made.append(self.picture(ax, f"Frequency response of {name}", f"{name} over force."))
        return ", ".join(r.name for r in records), made

    def _conditions(self) -> dict[str, list[object]]:
        first = {p.record: p for p in reversed(self.left.parts)}
        rows = [first[name] for name in self.records]
        found: dict[str, list[object]] = {
            "pose": [f"{p.pose + 1}" for p in rows],
            "direction of the blows": [direction_label(p.direction) for p in rows],
            "peak force of the blows [N]": [p.level for p in rows],
        }
        if len(set(found["direction of the blows"])) > 8:
            found["direction of the blows"] = [_octant(p.direction) for p in rows]
        if all(p.temperature is not None for p in rows):
            found["temperature [deg C]"] = [p.temperature for p in rows]
        taken = [p.taken for p in rows if p.taken is not None]
        if len(taken) == len(rows):
            found["days since the first record"] = [
                (when - min(taken)).total_seconds() / 86400.0 for when in taken
            ]
        return found


def _octant(direction: Sequence[float]) -> str:
    """The world axis that a direction is nearest to."""
    axis = int(np.argmax(np.abs(direction)))
    return "near " + ("+" if direction[axis] > 0 else "\N{MINUS SIGN}") + "xyz"[axis]
