"""What files state of springs, damping and force, as factors that are never exact."""

from __future__ import annotations

import math
from dataclasses import dataclass

from picchio.model.effects.effect import Effect

FACTOR = 0.7
"""Of the logarithm of a factor that nothing is known of: one deviation, a factor of two."""


@dataclass(frozen=True, eq=False)
class Factor:
    """A factor on what is stated; a fit moves its logarithm u.

    Attributes:
        effect: as stated: its one parameter at 1.
        std: of u beforehand.
    """

    effect: Effect
    std: float

    @property
    def label(self) -> str:
        """Name and target."""
        return self.effect.label

    @property
    def ends(self) -> tuple[float, float]:
        """Bounds of u."""
        (parameter,) = self.effect.parameters
        return math.log(max(parameter.lower, 1e-300)), math.log(min(parameter.upper, 1e20))

    def at(self, u: float) -> Effect:
        """The effect where the factor's logarithm is u.

        Args:
            u: the logarithm.
        """
        (parameter,) = self.effect.parameters
        return self.effect.bounded(**{parameter.name: math.exp(u)})
