"""The blow trains that a user can name: rectangular pulses, half-sines, a measured blow."""

from __future__ import annotations

import csv
import io
from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.core.errors import InputError
from picchio.core.files import read_text
from picchio.excitation.piecewise import PiecewiseForce


class Excitation(ABC):
    """A blow that repeats: what one period looks like, and the steady feed force beside it.

    Attributes:
        period: s, from one blow to the next.
        preload: N, steady feed force along the same direction; it is there before the first
            blow, so that it is a mean and no vibration.
    """

    period: float
    preload: float

    @abstractmethod
    def one_period(self) -> PiecewiseForce:
        """The force over one period."""

    @abstractmethod
    def describe(self) -> str:
        """One line for people."""

    def burst(self, hits: int) -> PiecewiseForce:
        """`hits` blows one period apart, then silence for ever."""
        return self.one_period().repeat(hits, then_silence=True)

    @property
    def peak_force(self) -> float:
        """The largest force of a blow, N (the number that `force` in a task states)."""
        return float(getattr(self, "force", 0.0))


def _check_train(force: float, period: float, width: float, preload: float) -> None:
    for key, value in (("force", force), ("period", period), ("width", width)):
        if not np.isfinite(value):
            raise InputError("must be a finite number", key=key, value=value)
    for key, value in (("period", period), ("width", width)):
        if value <= 0.0:
            raise InputError("must be positive", key=key, value=value)
    if not np.isfinite(preload):
        raise InputError("must be a finite number", key="preload", value=preload)
    if width >= period:
        raise InputError(
            f"the blow must be shorter than its period ({period:g} s)", key="width", value=width
        )


@dataclass(frozen=True)
class _Train(Excitation):
    """Equal blows, one a period: what every train states and how it is checked."""

    force: float
    period: float
    width: float
    preload: float = 0.0

    def __post_init__(self) -> None:
        _check_train(self.force, self.period, self.width, self.preload)


@dataclass(frozen=True)
class PulseTrain(_Train):
    """Rectangular pulses, the paper's Fig. 4 and eq. 12.

    Attributes:
        force: N, height of the pulse, F0.
        period: s, T.
        width: s, T_d, less than the period.
        preload: N, steady feed force.

    Raises:
        InputError: a number that is not finite, a period or width that is not positive, a
            width that is not less than the period.
    """

    def one_period(self) -> PiecewiseForce:
        """The pulse, then silence until the period ends."""
        zero = np.zeros(2)
        return PiecewiseForce(
            np.array([0.0, self.width]), self.period, np.array([self.force, 0.0]), zero, zero, zero
        )

    def describe(self) -> str:
        """One line for people."""
        return (
            f"rectangular pulses of {self.force:g} N, {self.width * 1e3:g} ms wide, "
            f"every {self.period * 1e3:g} ms"
        )


@dataclass(frozen=True)
class HalfSineTrain(_Train):
    """Half-sine blows: F0 sin(pi t / T_d) for 0 <= t < T_d, once a period.

    Attributes and errors: as `PulseTrain`; `force` is the peak.
    """

    def one_period(self) -> PiecewiseForce:
        """The half sine, then silence until the period ends."""
        zero = np.zeros(2)
        return PiecewiseForce(
            np.array([0.0, self.width]),
            self.period,
            zero,
            zero,
            np.array([-1j * self.force, 0.0]),  # Re(-1j F0 exp(1j w u)) = F0 sin(w u)
            np.array([np.pi / self.width, 0.0]),
        )

    def describe(self) -> str:
        """One line for people."""
        return (
            f"half-sine blows of {self.force:g} N peak, {self.width * 1e3:g} ms wide, "
            f"every {self.period * 1e3:g} ms"
        )


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
        if not (np.isfinite(time).all() and np.isfinite(samples).all()):
            bad = int(np.flatnonzero(~(np.isfinite(time) & np.isfinite(samples)))[0])
            raise InputError(f"sample {bad + 1} is not a finite number", **where)
        if not (np.diff(time) > 0).all():
            bad = int(np.flatnonzero(np.diff(time) <= 0)[0])
            raise InputError(f"the time of sample {bad + 2} does not ascend", **where)
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
    def from_csv(
        cls, path: str | Path, *, period: float | None = None, preload: float = 0.0
    ) -> MeasuredForce:
        """Read `time [s]` and `force [N]` columns.

        Args:
            path: a CSV file whose header names the two columns, in any order.
            period: s, as in the class.
            preload: N.

        Raises:
            InputError: missing file, header or number, with its line.
        """
        rows = list(csv.reader(io.StringIO(read_text(path))))
        header = [cell.strip() for cell in rows[0]] if rows else []
        wanted = ("time [s]", "force [N]")
        for name in wanted:
            if header.count(name) != 1:
                raise InputError(
                    f"the header must name one column {name!r}", file=path, value=header
                )
        columns = [header.index(name) for name in wanted]
        values = []
        for line, row in enumerate(rows[1:], start=2):
            if not row:
                continue
            try:
                values.append([float(row[c]) for c in columns])
            except (ValueError, IndexError):
                raise InputError(
                    f"line {line} does not hold two numbers", file=path, value=",".join(row)
                ) from None
        table = np.array(values).reshape(-1, 2)
        return cls(table[:, 0], table[:, 1], period or 0.0, preload, str(path))

    @property
    def peak_force(self) -> float:
        """The largest absolute force of the record, N."""
        return float(np.abs(self.samples).max())

    def one_period(self) -> PiecewiseForce:
        """The record, then silence until the period ends."""
        start, constant = self.time[:-1], self.samples[:-1]
        slope = np.diff(self.samples) / np.diff(self.time)
        if self.period > self.time[-1]:
            start = np.append(start, self.time[-1])
            constant, slope = np.append(constant, 0.0), np.append(slope, 0.0)
        zero = np.zeros(start.size)
        return PiecewiseForce(start, self.period, constant, slope, zero, zero)

    def describe(self) -> str:
        """One line for people."""
        name = Path(self.source).name if self.source else "a record"
        return (
            f"measured blows ({name}, peak {self.peak_force:g} N), every {self.period * 1e3:g} ms"
        )
