"""A record's clock: its rate, and whether it is even."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from picchio.campaign.channels import TIME
from picchio.campaign.source import Source
from picchio.core.arrays import FloatArray

# Times are often written with few decimals: 51.2 kHz with six makes 2.6 % of a step.
TOLERANCE = 0.05
# An even clock is checked at every sample against its neighbour, and at these strides against
# the straight line through its ends, so that memory does not grow with the record.
_STRIDE = 1024
SLOWEST, FASTEST = 1e-3, 1e9
"""Hz: sample rates that a record may have."""
_LATEST = 4_102_444_800.0  # s from 1970 to 2100: no record begins later
_UNITS = ("s", "ms", "us", "ns")


def not_seconds(start: float, step: float, scale: float = 1.0) -> str | None:
    """Why stamps cannot be in the unit they are said to be in, in words; None where they can.

    A logger's nanoseconds that are read as seconds make a record of centuries.

    Args:
        start: s, the first stamp, as converted from that unit.
        step: s, from one sample to the next.
        scale: s, that unit.

    Returns:
        a clause that names the unit they probably are in.
    """
    if abs(start) <= _LATEST and step <= 1.0 / SLOWEST:
        return None
    problem = f"the first stamp is at {start:.6g} s and the next {step:.3g} s later"
    said = round(-math.log10(scale) / 3.0)
    for finer in range(1, len(_UNITS) - max(said, 0)):
        if abs(start) * 1e-3**finer <= _LATEST and step * 1e-3**finer <= 0.1:
            return f"{problem}: the time is probably in {_UNITS[said + finer]}, not {_UNITS[said]}"
    return f"{problem}: is the unit of the time right?"


@dataclass(frozen=True)
class Clock:
    """An even clock.

    Attributes:
        start: s, the first sample.
        step: s, the mean step.
        samples: how many.
        jitter: the largest departure of a step from the mean, or of a sample from the straight
            line, in steps.
        worst: index of the sample where it was found.
    """

    start: float
    step: float
    samples: int
    jitter: float
    worst: int

    @property
    def rate(self) -> float:
        """Samples a second, Hz."""
        return 1.0 / self.step

    @property
    def end(self) -> float:
        """The last sample's time, s."""
        return self.start + self.step * (self.samples - 1)


class ClockCheck:
    """Takes a record's times block by block and refuses an uneven clock.

    Args:
        source: for messages.
        tolerance: the largest jitter, in steps; infinite to take any clock that ascends.
    """

    def __init__(self, source: Source, tolerance: float = TOLERANCE) -> None:
        self.source = source
        self.tolerance = tolerance
        self._samples = 0
        self._first = self._last = self._step = 0.0
        self._strided: list[FloatArray] = []
        self._worst = (0.0, 0)

    def feed(self, time: FloatArray, first: int) -> None:
        """Check the next block.

        Raises:
            InputError: a time that does not ascend, or a step unlike the others, with its line.
        """
        if self._samples == 0:
            self._first = float(time[0])
            steps = np.diff(time)
            usual = float(np.median(steps)) if steps.size else 0.0
            if problem := not_seconds(self._first, usual, self.source.time_scale):
                raise self.source.error(problem, channel=TIME)
        else:
            steps = np.diff(time, prepend=self._last)
        offset = first + (1 if self._samples == 0 else 0)
        if steps.size:
            self._check_steps(steps, offset, time)
        skip = -first % _STRIDE
        self._strided.append(time[skip::_STRIDE].copy())
        self._samples = first + time.size
        self._last = float(time[-1])

    def _check_steps(self, steps: FloatArray, offset: int, time: FloatArray) -> None:
        """Refuse the first bad step, keep the worst of the others."""
        self._step = self._step or float(np.median(steps))
        away = np.abs(steps / self._step - 1.0) if self._step > 0.0 else np.zeros(steps.size)
        # Two neighbours may be rounded in opposite ways.
        bad = np.flatnonzero((steps <= 0.0) | (away > 2.0 * self.tolerance))
        if bad.size:
            sample, step = offset + int(bad[0]), float(steps[bad[0]])
            if step <= 0.0:
                value = float(time[bad[0] - steps.size])
                raise self.source.error("the time does not ascend", channel=TIME, sample=sample,
                                        value=value)  # fmt: skip
            raise self.source.error(
                f"the clock is not even: this step is {step / self._step:.4g} times the usual "
                f"{self._step:.6g} s",
                channel=TIME,
                sample=sample,
            )
        worst = int(away.argmax())
        if away[worst] > self._worst[0]:
            self._worst = (float(away[worst]), offset + worst)

    def finish(self) -> Clock:
        """The clock of the whole record.

        Raises:
            InputError: fewer than two samples, or a clock that drifts from a straight line.
        """
        if self._samples < 2:
            problem = "is empty" if self._samples == 0 else "holds one sample; a clock needs two"
            raise self.source.error(problem, channel=TIME if self._samples else None)
        step = (self._last - self._first) / (self._samples - 1)
        strided = np.concatenate(self._strided)
        line = self._first + step * _STRIDE * np.arange(strided.size)
        away = np.abs(strided - line) / step
        jitter, worst = self._worst
        if away.max() > jitter:
            jitter, worst = float(away.max()), int(away.argmax()) * _STRIDE
        if away.max() > self.tolerance:
            raise self.source.error(
                f"the clock is not even: it departs by {away.max():.3g} steps from its mean rate",
                channel=TIME,
                sample=worst,
            )
        return Clock(self._first, step, self._samples, jitter, worst)
