"""A sensor whose axes are swapped or turned round."""

from __future__ import annotations

from itertools import permutations, product

import numpy as np

from picchio.model.conditions import Conditions
from picchio.model.effects.effect import Effect, Parameter
from picchio.model.sensing import Sensors

CHOICES = tuple(
    (order, signs) for order in permutations(range(3)) for signs in product((1, -1), repeat=3)
)


class SensorAxes(Effect):
    """The group's x, y, z show other axes of the truth, some of them with the other sign."""

    name = "sensor_axes"
    where = "sensor"
    target_kind = "channel group"
    among = ("vectors",)
    parameters = (
        Parameter("code", lower=0, upper=47, meaning="which of the 48 signed permutations"),
    )
    meaning = "cables are swapped or a sensor is mounted the wrong way round"
    discrete = True
    tried = tuple({"code": float(code)} for code in range(1, len(CHOICES)))  # all but the identity

    @property
    def axes(self) -> str:
        """What x, y and z really show, such as "y-xz"."""
        order, signs = CHOICES[round(self.values["code"])]
        return "".join(("-" if s < 0 else "") + "xyz"[o] for o, s in zip(order, signs, strict=True))

    def sense(self, sensors: Sensors, conditions: Conditions) -> None:
        """Permute the axes."""
        order, signs = CHOICES[round(self.values["code"])]
        turn = np.zeros((3, 3))
        turn[range(3), order] = signs
        chain = sensors.chain(self.target)
        chain.turn = turn @ chain.turn
