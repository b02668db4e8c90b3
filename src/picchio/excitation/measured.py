"""A force history that was measured."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.core.tables import read_columns
from picchio.excitation.excitation import Excitation
from picchio.excitation.piecewise import PiecewiseForce

# Samples of the quiet time from which a force sensor's noise is known, and how many of its standard
# deviations a force is above. These are half of what lies between two quantiles, which a first blow
# that begins early does not move.
_QUIET, _NOISE = 20, 5.0
_BETWEEN = (0.0228, 0.5, 0.9772)  # two standard deviations to either side


@dataclass(frozen=True, eq=False)
class MeasuredForce(Excitation):
    """A measured force history, straight lines between its samples, repeated every period.

    Attributes:
        time: (m,) s, ascending; counted from the first sample.
        samples: (m,) N.
        period: s, from one repetition to the next; the length of the record when not given.
            Between the record's end and the period's end the force is zero.
        preload: N, steady feed force.
        source: the file, for messages.
    """

    kind = "measured"
    meaning = "a measured force history, repeated every period"
    needed = ("file",)
    optional = ("period", "preload")
    programmed = False
    force = None
    width = None

    time: FloatArray
    samples: FloatArray
    period: float = 0.0
    preload: float = 0.0
    source: str | None = None

    def __post_init__(self) -> None:
        time = np.array(self.time, dtype=float)
        samples = np.array(self.samples, dtype=float)
        where = {"file": self.source}
        if time.ndim != 1 or time.shape != samples.shape or time.size < 2:
            raise InputError("needs two or more samples, one force for each time", **where)
        finite = np.isfinite(time) & np.isfinite(samples)
        if not finite.all():
            raise InputError(f"sample {finite.argmin() + 1} is not a finite number", **where)
        ascends = np.diff(time) > 0.0
        if not ascends.all():
            problem = f"the time of sample {ascends.argmin() + 2} does not ascend"
            raise InputError(problem, **where)
        time = time - time[0]
        period = float(self.period) or float(time[-1])
        # The last sample closes the record, so a record as long as the period is allowed.
        if not np.isfinite(period) or period < time[-1] * (1.0 - 1e-9):
            raise InputError(
                f"must not be shorter than the record ({time[-1]:g} s)",
                key="period",
                value=self.period,
                **where,
            )
        for name, value in (("time", time), ("samples", samples)):
            value.flags.writeable = False
            object.__setattr__(self, name, value)
        object.__setattr__(self, "period", max(period, float(time[-1])))

    @classmethod
    def from_table(cls, values: dict[str, Any], folder: Path) -> Self:
        """As `Excitation.from_table`; the CSV is `file`."""
        given = {key: values[key] for key in cls.optional if key in values}
        return cls.from_csv(folder / values["file"], **given)

    @classmethod
    def from_csv(
        cls, path: str | Path, *, period: float | None = None, preload: float = 0.0
    ) -> Self:
        """Read `time [s]` and `force [N]` columns.

        Args:
            path: a CSV file whose header names the two columns, in any order.
            period: s, as in the class.
            preload: N.

        Returns:
            the force, repeated every period.

        Raises:
            InputError: missing file, header or number, with its line.
        """
        table = np.reshape(read_columns(path, ("time [s]", "force [N]")), (-1, 2))
        return cls(table[:, 0], table[:, 1], period or 0.0, preload, str(path))

    @classmethod
    def from_start(cls, time: FloatArray, samples: FloatArray) -> Self:
        """The force of a record from t = 0 on, which may lie between two of its samples.

        Where it does not rise out of the noise that the quiet time before shows, there is none: the
        sensor's noise would shake the model for as long as the record lasts. What it reads then is
        its zero.

        Args:
            time: (m,) s, ascending; before 0 it is quiet.
            samples: (m,) N.
        """
        quiet = samples[time < -1e-12]
        if quiet.size >= _QUIET:
            low, rest, high = np.quantile(quiet, _BETWEEN)
            acts = np.abs(samples - rest) > _NOISE * (high - low) / 4.0
            beside = np.convolve(acts, np.ones(3), "same") > 0.0  # where a blow begins and ends
            samples = np.where(beside, samples - rest, 0.0)
        after = time > 1e-12
        return cls(
            np.concatenate([[0.0], time[after]]),
            np.concatenate([[np.interp(0.0, time, samples)], samples[after]]),
        )

    @property
    def peak_force(self) -> float:
        """The largest absolute force of the record, N."""
        return float(np.abs(self.samples).max())

    def blow(self) -> PiecewiseForce:
        """The record."""
        slope = np.diff(self.samples) / np.diff(self.time)
        zero = np.zeros(slope.size)
        return PiecewiseForce(
            self.time[:-1], float(self.time[-1]), self.samples[:-1], slope, zero, zero
        )

    def scaled(self, force: float = 1.0, width: float = 1.0) -> Self:
        """The same history, so many times as high.

        Raises:
            InputError: a width is to be varied, which a measured history does not state.
        """
        if width != 1.0:
            raise InputError("a measured force states no width to vary", key="width")
        return self if force == 1.0 else replace(self, samples=force * self.samples)

    def describe(self) -> str:
        """One line for people."""
        every = f", every {self.period * 1e3:g} ms"
        if not self.source:  # such as the force beside the response, which is not repeated
            length = float(self.time[-1])
            lasts = f"measured force (peak {self.peak_force:.4g} N, {length * 1e3:.4g} ms)"
            return lasts + (every if self.period > length else "")
        return f"measured blows ({Path(self.source).name}, peak {self.peak_force:g} N){every}"
