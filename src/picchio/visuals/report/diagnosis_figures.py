"""The pictures of a diagnosis, each with words that say what it shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes

from picchio.campaign.channels import Channel
from picchio.core.arrays import FloatArray
from picchio.diagnosis.percussion.criteria.bic import bic
from picchio.diagnosis.percussion.data.record import MeasuredRecord
from picchio.diagnosis.percussion.diagnosis import PercussionDiagnosis
from picchio.diagnosis.percussion.fit.least_squares import Fit
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.visuals.plots.diagnosis import (
    plot_bands,
    plot_left_over,
    plot_overlay,
    plot_place,
    plot_scores,
    telling_window,
)
from picchio.visuals.plots.style import blank_figure, direction_label
from picchio.visuals.report.page import number, themed_svg

# Blow periods that an overlay shows.
_PERIODS = 10.0
_FEWEST_SECONDS = 0.15
# Candidates that a picture of a step shows; a wider search fits many more.
_SHOWN = 12


@dataclass(frozen=True)
class Picture:
    """An inline SVG and what is written under it."""

    svg: Markup
    caption: str


@dataclass(frozen=True)
class View:
    """One channel of one record.

    Attributes:
        record: the record.
        channel: the channel.
        row: its place among the record's.
        times: residual's RMS over the noise.
    """

    record: MeasuredRecord
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

    def window(self, difference: FloatArray) -> tuple[float, float]:
        """The stretch that shows a difference best, s."""
        length = max(_PERIODS * self.record.setup.blows.interval, _FEWEST_SECONDS)
        return telling_window(self.time, difference, length)


def worst_view(fit: Fit, names: tuple[str, ...] | None = None) -> View:
    """The record and channel that a fit leaves most of, over the noise.

    Args:
        fit: with residuals of all its records.
        names: only records of these names.
    """
    best: View | None = None
    for record, residual in zip(fit.records, fit.residuals, strict=True):
        if names is not None and record.name not in names:
            continue
        channels = {c.name: c for c in record.setup.channels}
        for row, name in enumerate(record.values):
            times = float(np.sqrt(np.mean(residual[row] ** 2)))
            if best is None or times > best.times:
                best = View(record, channels[name], row, times)
    if best is None:
        return worst_view(fit)
    return best


class DiagnosisFigures:
    """Draws a diagnosis.

    Args:
        found: the diagnosis.
    """

    def __init__(self, found: PercussionDiagnosis) -> None:
        self.found = found
        self.worst = worst_view(found.baseline)
        self.changed = bool(found.extended.hypothesis.labels)
        self.claimed = tuple((c.effect, c.target) for c in found.diagnosis.causes)
        self._made = 0

    def _picture(self, ax: Axes, alt: str, caption: str) -> Picture:
        self._made += 1
        return Picture(themed_svg(ax, alt, f"d{self._made}"), caption)

    def wrong(self) -> Picture:
        """The simulation over the measurement, where a person sees it."""
        view = self.worst
        predicted = self._predict(self.found.baseline.hypothesis, view)
        window = view.window(view.measured - predicted)
        ax = plot_overlay(view.time, view.measured, {"simulated": predicted}, view.channel,
                          blank_figure(9.0, 3.0), window=window)  # fmt: skip
        alt = f"{view.channel.name} as measured and as simulated from {window[0]:.3g} to "
        alt += f"{window[1]:.3g} seconds"
        return self._picture(ax, alt, f"{view.channel.name} in {view.where}: the nominal model, "
                             "stiffness, damping and force fitted within their tolerance. Its "
                             f"residual is {view.times:.3g} times the noise (RMS), more than in "
                             "any other channel.")  # fmt: skip

    def left_over(self) -> list[Picture]:
        """The residual of the same channel, before and after."""
        view = self.worst
        before, after = self._residuals(view)
        blows = self._blow_times(view)
        ax = plot_left_over(view.time, before, after, blank_figure(9.0, 2.5), blows=blows)
        words = "what the simulation leaves of this channel, in standard deviations of its noise"
        made = [self._picture(ax, words, f"{words.capitalize()}.")]
        if after is not None:
            ax = plot_left_over(view.time, before, after, blank_figure(9.0, 2.1), blows=blows,
                                zoom=True)  # fmt: skip
            rms = float(np.sqrt(np.mean(after**2)))
            made.append(self._picture(ax, "the residual after, on its own scale",
                        f"After, on its own scale: {rms:.3g} times the noise (RMS)."))  # fmt: skip
        return made

    def held_out(self) -> Picture | None:
        """Before and after in a record that neither model was fitted to."""
        gain = self.found.diagnosis.gain
        if gain is None or not gain.held_out_records or not self.changed:
            return None
        view = worst_view(self.found.baseline, gain.held_out_records)
        before = self._predict(self.found.search.baseline.hypothesis, view)
        unseen = self.found.search.best.hypothesis
        latent = any(e.hidden for e in unseen.effects)
        after = self._predict(self.found.extended.hypothesis if latent else unseen, view)
        ax = plot_overlay(view.time, view.measured, {"before": before, "after": after},
                          view.channel, blank_figure(9.0, 3.0),
                          window=view.window(view.measured - before))  # fmt: skip
        fitted = ("fitted to this record too, since some numbers are drawn anew in each" if latent
                  else "neither model has seen this record")  # fmt: skip
        if gain.held_out_records == gain.train_records:
            fitted = "too few records to hold any out: this one was fitted"
        return self._picture(ax, f"{view.channel.name} as measured, before and after",
                             f"{view.channel.name} in {view.where}; {fitted}.")  # fmt: skip

    def scores(self) -> list[Picture]:
        """The candidates, a picture a step of the search."""
        rows = list(self.found.diagnosis.scores)
        start = self.found.search.baseline
        without = (bic(start), start.chi_square / max(start.samples, 1))
        stand = tuple(tuple(x.split(":", 1)) for x in self.found.extended.hypothesis.labels)
        made = []
        for step in sorted({row["step"] for row in rows}):
            tried = [row for row in rows if row["step"] == step]
            here = tried[:_SHOWN]  # the best come first
            ax = plot_scores(here, without, blank_figure(9.0, 1.0 + 0.27 * len(here)),
                             chosen=stand)  # type: ignore[arg-type]  # fmt: skip
            best = min(here, key=lambda row: row["bic"])
            left = [f"{_words(row)} {row['chi_square_per_sample'] ** 0.5:.3g}" for row in here]
            alt = f"Candidates of step {step} and what each leaves over the noise: "
            alt += ", ".join(left)
            kept = (best["effect"], best["target"]) in stand
            caption = f"Step {step} of the search: " + (
                f"{_words(best)} does best." if kept else "nothing that could be kept."
            )
            if len(tried) > len(here):
                caption += f" {len(tried) - len(here)} more did no better."
            made.append(self._picture(ax, alt, caption))
            without = (best["bic"], best["chi_square_per_sample"])
        return made

    def bands(self) -> list[Picture]:
        """Power by frequency against the noise, a picture a channel group."""
        modes = self._natural_frequencies()
        made = []
        groups = list(dict.fromkeys(level.group for level in self.found.before.bands))
        width = 5.2 if len(groups) > 1 else 9.4
        for group in groups:
            before = [x for x in self.found.before.bands if x.group == group]
            after = [x for x in self.found.after.bands if x.group == group and self.changed]
            ax = plot_bands(before, after, blank_figure(width, 3.0), natural_frequencies=modes)
            most = max(before, key=lambda level: level.power)
            made.append(self._picture(ax, f"Residual power of {group} by frequency",
                        f"{group}: most is left at {most.part}, {number(most.power, 3)} times "
                        "the noise's power."))  # fmt: skip
        return made

    def place(self) -> Picture:
        """The causes on the robot."""
        setup = self.worst.record.setup
        ax = plot_place(self.found.problem.robot, setup.geometry.pose, self.claimed,
                        blank_figure(3.7, 3.9), direction=setup.blows.direction)  # fmt: skip
        named = ", ".join(f"{e} at {t}" for e, t in self.claimed) or "nothing"
        return self._picture(ax, f"The robot from the side, with {named} marked",
                             f"The robot at pose {self.worst.record.pose + 1}; the arrow is "
                             "the tool's force.")  # fmt: skip

    def _predict(self, hypothesis: Hypothesis, view: View) -> FloatArray:
        """The channel as the hypothesis has it, its free offset as the measurement's."""
        values = self.found.problem.predictions(hypothesis.effects, [view.record])[0]
        predicted = values[view.channel.name]
        if view.record.setup.steady or view.channel.kind.free_offset:
            predicted = predicted + float(np.mean(view.measured - predicted))
        return predicted

    def _residuals(self, view: View) -> tuple[FloatArray, FloatArray | None]:
        index = [r.name for r in self.found.baseline.records].index(view.record.name)
        before = self.found.baseline.residuals[index][view.row]
        after = self.found.extended.residuals[index][view.row] if self.changed else None
        return before, after

    def _blow_times(self, view: View) -> FloatArray:
        start = np.unique(view.record.setup.blows.start)
        return np.asarray(start[start <= view.time[-1]])

    def _natural_frequencies(self) -> list[float]:
        """Hz, of the nominal robot at the first picture's pose."""
        setup = self.worst.record.setup
        system = self.found.problem.model.plant(setup.geometry).build(setup.blows.direction)
        squared = np.linalg.eigvals(np.linalg.solve(system.mass, system.stiffness)).real
        return sorted(np.sqrt(squared[squared > 0.0]) / (2.0 * np.pi))


def _words(row: object) -> str:
    return f"{row['effect'].replace('_', ' ')} of {row['target']}"  # type: ignore[index]
