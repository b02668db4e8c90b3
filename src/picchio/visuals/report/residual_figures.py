"""The pictures of a residual report."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from picchio.diagnosis.percussion.residual import (
    PercussionResidual,
    over_time,
    restoring,
    transfers,
)
from picchio.prediction.residual import together
from picchio.visuals.plots.diagnosis import plot_left_over, plot_overlay
from picchio.visuals.plots.frequency import plot_transfer
from picchio.visuals.plots.residual import (
    plot_by_condition,
    plot_over_time,
    plot_residual_map,
    plot_residual_spectrum,
    plot_restoring,
)
from picchio.visuals.plots.style import blank_figure, direction_label
from picchio.visuals.report.diagnosis_figures import Picture, worst_view
from picchio.visuals.report.page import number, themed_svg


class ResidualFigures:
    """Draws what a baseline leaves.

    Args:
        left: what the nominal model leaves.
    """

    def __init__(self, left: PercussionResidual) -> None:
        self.problem, self.fit, self.parts = left.problem, left.fit, left.parts
        self.spectra, self.predictions = left.spectra, left.predictions
        self.worst = worst_view(left.fit)
        self.groups = tuple(dict.fromkeys(p.group for p in left.parts))
        self._made = 0

    def _picture(self, ax: Axes, alt: str, caption: str) -> Picture:
        self._made += 1
        return Picture(themed_svg(ax, alt, f"r{self._made}"), caption)

    def overlay(self) -> list[Picture]:
        """Measured and simulated, and their difference, where it shows most."""
        view = self.worst
        index = [r.name for r in self.fit.records].index(view.record.name)
        predicted = self.predictions[index][view.channel.name]
        if view.record.setup.steady or view.channel.kind.free_offset:
            predicted = predicted + float(np.mean(view.measured - predicted))
        window = view.window(view.measured - predicted)
        ax = plot_overlay(view.time, view.measured, {"simulated": predicted}, view.channel,
                          blank_figure(9.0, 3.0), window=window)  # fmt: skip
        made = [self._picture(ax, f"{view.channel.name} as measured and as simulated",
                              f"{view.channel.name} in {view.where}: where the simulation is "
                              "furthest from the measurement, in units of its noise.")]  # fmt: skip
        starts = np.unique(view.record.setup.blows.start)
        white = self.fit.residuals[index][view.row]
        ax = plot_left_over(view.time, white, None, blank_figure(9.0, 2.4),
                            blows=starts[starts <= view.time[-1]])  # fmt: skip
        made.append(self._picture(ax, "Residual of this channel over time",
                    f"What is left of it: {view.times:.3g} times the noise (RMS)."))  # fmt: skip
        return made

    def map(self) -> Picture:
        """Records by channels."""
        records = list(dict.fromkeys(p.record for p in self.parts))
        channels = list(dict.fromkeys(p.channel for p in self.parts))
        values = np.full((len(records), len(channels)), np.nan)
        for p in self.parts:
            values[records.index(p.record), channels.index(p.channel)] = p.times
        height = 1.3 + 0.2 * min(len(records), 60)
        ax = plot_residual_map(values, records, channels, blank_figure(9.0, height))
        return self._picture(ax, "Residual over noise of every record and channel",
                             "Residual over noise (RMS); 1 is noise. A bright column is a "
                             "channel that is wrong in all records, a bright row a "
                             "record.")  # fmt: skip

    def by_frequency(self) -> Picture:
        """Spectrum of all records together."""
        ax = plot_residual_spectrum(self.spectra.edges, self.spectra.power,
                                    blank_figure(9.0, 3.4), modes=self.spectra.modes,
                                    hit_rate=self.spectra.hit_rate)  # fmt: skip
        group, at, power = self.spectra.worst
        return self._picture(ax, "Residual power by frequency",
                             f"Most is left of {group} near {at:.3g} Hz: {number(power, 3)} times "
                             "the noise's power. The bands are the nominal model's natural "
                             "frequencies over the poses.")  # fmt: skip

    def by_time(self) -> Picture:
        """Hit by hit."""
        found = over_time(self.fit)
        ax = plot_over_time(found.edges, found.residual, found.signal, blank_figure(9.0, 3.0),
                            last_blow=found.last_blow)  # fmt: skip
        return self._picture(ax, "Residual hit by hit",
                             "All records together, a window a hit. Compare the residual with "
                             "the signal: does it grow from hit to hit, die out with the "
                             "vibration, or outlast it?")  # fmt: skip

    def by_condition(self) -> list[Picture]:
        """By pose, direction, level, temperature, date."""
        made = []
        for what, values in self._conditions().items():
            if len(set(values)) < 2:
                continue
            shares = {g: [self._share(r, g)[0] for r in self._records()] for g in self.groups}
            floors = {g: [self._share(r, g)[1] for r in self._records()] for g in self.groups}
            ax = plot_by_condition(values, shares, floors, what, blank_figure(5.2, 3.0))
            made.append(
                self._picture(
                    ax, f"Residual over signal by {what}", f"By {what.partition(' [')[0]}."
                )
            )
        return made

    def restoring(self) -> list[Picture]:
        """Missing torque over deflection and velocity, two pictures a joint."""
        kinds = {j.name: j.kind for j in self.problem.robot.flexible_joints}
        made = []
        found = restoring(self.problem, self.fit, self.predictions)
        for name, (record, one) in found.items():
            for over, x in (("deflection", one.deflection), ("velocity", one.velocity)):
                ax = plot_restoring(x, one.torque, name, blank_figure(5.2, 3.0), over=over,
                                    prismatic=kinds[name] == "prismatic")  # fmt: skip
                made.append(self._picture(ax, f"Missing torque of {name} over its {over}",
                                          f"{name}, over its {over}, in {record}."))  # fmt: skip
        return made

    def transfers(self) -> tuple[str, list[Picture]]:
        """Frequency responses."""
        records, found = transfers(self.fit, self.predictions)
        made = []
        highest = 2.0 * max(high for _, high in self.spectra.modes)
        for name, one in found.items():
            channel = self.problem.campaign[records[0].name].channel(name)
            ax = plot_transfer(one, channel, blank_figure(5.2, 3.2), highest=highest)
            made.append(self._picture(ax, f"Frequency response of {name}", f"{name} over force."))
        return ", ".join(r.name for r in records), made

    def _records(self) -> list[str]:
        return list(dict.fromkeys(p.record for p in self.parts))

    def _share(self, record: str, group: str) -> tuple[float, float]:
        rows = [p for p in self.parts if p.record == record and p.group == group]
        whole = together(rows)
        return (whole.nrmse, whole.floor) if rows else (math.nan, math.nan)

    def _conditions(self) -> dict[str, list[object]]:
        first = {p.record: p for p in reversed(self.parts)}
        rows = [first[name] for name in self._records()]
        found: dict[str, list[object]] = {
            "pose": [f"{p.pose + 1}" for p in rows],
            "direction of the blows": [direction_label(p.direction) for p in rows],
            "height of the blows [N]": [p.level for p in rows],
        }
        if len(set(found["direction of the blows"])) > 8:
            found["direction of the blows"] = [_octant(p.direction) for p in rows]
        if all(p.temperature is not None for p in rows):
            found["temperature [deg C]"] = [p.temperature for p in rows]
        if all(p.taken is not None for p in rows):
            start = min(p.taken for p in rows if p.taken is not None)
            found["days since the first record"] = [
                (p.taken - start).total_seconds() / 86400.0 for p in rows if p.taken is not None
            ]
        return found


def _octant(direction: Sequence[float]) -> str:
    """The world axis that a direction is nearest to."""
    axis = int(np.argmax(np.abs(direction)))
    return "near " + ("+" if direction[axis] > 0 else "\N{MINUS SIGN}") + "xyz"[axis]
