"""What every claim, conflict and figure is computed from: the base world and random others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

from picchio.paper.assumptions import Assumptions
from picchio.paper.printed import Printed, printed
from picchio.paper.table2.by_curve import CurveOfTable, curve_of_table
from picchio.paper.table2.compare import Comparison, compare_hypotheses
from picchio.paper.table2.place import FREE, decode
from picchio.paper.world import World, random_worlds

WORLDS = 160
"""How many worlds are drawn beside the base."""


@dataclass(frozen=True, eq=False)
class Study:
    """One run of the reproduction; everything is computed when first needed.

    Attributes:
        given: the base world's assumptions.
        count: worlds drawn beside it.
        seed: of the draw.
    """

    given: Assumptions
    count: int = WORLDS
    seed: int = 0
    progress: Callable[[int, int], None] | None = None

    @property
    def printed(self) -> Printed:
        """What the paper prints."""
        return printed()

    @cached_property
    def base(self) -> World:
        """The world of the given assumptions."""
        return World(self.given, fine=True)

    @cached_property
    def worlds(self) -> tuple[World, ...]:
        """The base, and random others."""
        return (self.base, *random_worlds(self.count, self.seed, self.given))

    @cached_property
    def curve_of_table(self) -> CurveOfTable:
        """Table 2's lives against its stresses, without an arm."""
        return curve_of_table(self.printed)

    @cached_property
    def fitted(self) -> World:
        """The world that comes nearest to Table 2's eight mean stresses."""
        fit = self.comparison.alike[0]
        values = decode(fit.vector[: len(FREE)])
        return World(fit.place.base.but(**values, stress_per_twist=fit.stress_per_twist))

    @cached_property
    def comparison(self) -> Comparison:
        """The hypotheses of Table 2, with the arm."""
        return compare_hypotheses(self.printed, self.given, self.progress)
