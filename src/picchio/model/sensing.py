"""What stands between the motion and the number that is written down: a chain of sensor stages."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Literal

import numpy as np

from picchio.core.arrays import FloatArray


@dataclass(frozen=True)
class Filter:
    """A Butterworth filter of a sensor's electronics or of its logger.

    Attributes:
        frequency: Hz, the corner.
        order: 1 or 2.
        digital: of the samples, by the bilinear transform; else of the signal itself.
    """

    frequency: float
    order: int = 1
    digital: bool = False

    def analogue(self, kind: Literal["low", "high"]) -> tuple[FloatArray, FloatArray]:
        """Its transfer function in s.

        Args:
            kind: what passes.

        Returns:
            (order + 1,) of numerator and denominator, highest power first.
        """
        return _butterworth(self.order, 2.0 * np.pi * self.frequency, kind, True)

    def sampled(self, kind: Literal["low", "high"], step: float) -> tuple[FloatArray, FloatArray]:
        """Its transfer function in the delay by one sample.

        Args:
            kind: what passes.
            step: s, between samples; a corner above what they can carry is brought just below.

        Returns:
            (order + 1,) of numerator and denominator, the undelayed first.
        """
        return _butterworth(self.order, min(2.0 * self.frequency * step, _NYQUIST), kind, False)


# Of half the rate: the highest corner of a digital filter.
_NYQUIST = 0.99


@lru_cache(maxsize=256)
def _butterworth(
    order: int, corner: float, kind: Literal["low", "high"], analogue: bool
) -> tuple[FloatArray, FloatArray]:
    """Numerator and denominator: designed once, and asked for by every record."""
    from scipy.signal import butter

    found: tuple[FloatArray, FloatArray] = butter(order, corner, kind, analog=analogue)
    for part in found:
        part.flags.writeable = False
    return found


@dataclass
class SensorChain:
    """How one channel group ("accelerometer.tool", "deflection") reads.

    The order is that of the signal's way: resonance of the mount, axes, gain, filters, clock,
    clipping, hum.

    Attributes:
        mount: (frequency Hz, damping ratio) of a resonant mount.
        place: (3,) m, from the frame's origin to the sensor, in the frame's axes.
        turn: (3, 3) from what the frame's axes carry to what the sensor's axes read.
        gain: factor.
        highpass: takes out slow motion.
        lowpass: takes out fast motion.
        delay: s, the reading is late by this.
        clock_rate: a sample stamped t is of the time t (1 + clock_rate).
        limit: the reading is clipped to +-limit; infinite where it is not.
        hum: (frequency Hz, cosine, sine amplitude) of added lines, in the channel's unit.
    """

    mount: tuple[float, float] | None = None
    place: FloatArray = field(default_factory=lambda: np.zeros(3))
    turn: FloatArray = field(default_factory=lambda: np.eye(3))
    gain: float = 1.0
    highpass: Filter | None = None
    lowpass: Filter | None = None
    delay: float = 0.0
    clock_rate: float = 0.0
    limit: float = np.inf
    hum: list[tuple[float, float, float]] = field(default_factory=list)

    def passes(self, digital: bool) -> list[tuple[Literal["low", "high"], Filter]]:
        """Its filters of one kind that have something to take out.

        Args:
            digital: those of the samples, or else of the signal.
        """
        pairs = (("high", self.highpass), ("low", self.lowpass))
        return [
            (kind, each)  # type: ignore[misc]
            for kind, each in pairs
            if each is not None and each.digital == digital and 0.0 < each.frequency < np.inf
        ]

    @property
    def analogue(self) -> bool:
        """Whether the reading depends on what the signal was between the samples before."""
        return self.mount is not None or bool(self.passes(digital=False))

    @property
    def filters(self) -> bool:
        """Whether the reading depends on what came before."""
        return self.analogue or bool(self.passes(digital=True))

    @property
    def smooth(self) -> bool:
        """Whether its filters let no jump through at once."""
        return self.mount is not None or "low" in dict(self.passes(digital=False))

    @property
    def timing(self) -> tuple[float, float]:
        """(delay, clock rate): what changes the times at which the motion is needed."""
        return self.delay, self.clock_rate


_IDEAL = SensorChain()


class Sensors:
    """The chains of all channel groups; those that nothing has changed are ideal."""

    def __init__(self) -> None:
        self._chains: dict[str, SensorChain] = {}

    def chain(self, group: str) -> SensorChain:
        """The chain of a group, to be changed.

        Args:
            group: of channels, such as "accelerometer.tool".
        """
        return self._chains.setdefault(group, SensorChain())

    def get(self, group: str) -> SensorChain:
        """The chain of a group, to be read.

        Args:
            group: of channels, such as "accelerometer.tool".
        """
        return self._chains.get(group, _IDEAL)
