"""What stands between the motion and the number that is written down: a chain of sensor stages."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from picchio.core.arrays import FloatArray


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
        highpass: Hz, first order.
        lowpass: Hz, first order.
        delay: s, the reading is late by this.
        clock_rate: a sample stamped t is of the time t (1 + clock_rate).
        limit: the reading is clipped to +-limit; infinite where it is not.
        hum: (frequency Hz, cosine, sine amplitude) of added lines, in the channel's unit.
    """

    mount: tuple[float, float] | None = None
    place: FloatArray = field(default_factory=lambda: np.zeros(3))
    turn: FloatArray = field(default_factory=lambda: np.eye(3))
    gain: float = 1.0
    highpass: float | None = None
    lowpass: float | None = None
    delay: float = 0.0
    clock_rate: float = 0.0
    limit: float = np.inf
    hum: list[tuple[float, float, float]] = field(default_factory=list)

    @property
    def filters(self) -> bool:
        """Whether the reading depends on what came before."""
        return self.mount is not None or self.highpass is not None or self.lowpass is not None

    @property
    def smooth(self) -> bool:
        """Whether its filters let no jump through at once."""
        return self.mount is not None or self.lowpass is not None

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
