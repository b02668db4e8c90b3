"""What every claim, conflict and figure is computed from: the base world and random others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from picchio.paper.equations import check_phase
from picchio.paper.life import Influence, Sequences, Step, find_sequences, influences, waterfall
from picchio.paper.printed import Printed, printed
from picchio.paper.table2.by_arm import FREE, Comparison, compare_hypotheses, decode
from picchio.paper.table2.by_curve import CurveOfTable, curve_of_table
from picchio.paper.world import Assumptions, World, random_worlds

WORLDS = 160
"""How many worlds are drawn beside the base."""


@dataclass(frozen=True, eq=False)
class Study:
    """One run of the reproduction; everything is computed when first needed.

    Attributes:
        given: the base world's assumptions.
        count: worlds drawn beside it.
        seed: of the draw.
        progress: called with (steps done, steps in all).
        printed: what the paper prints.
    """

    given: Assumptions
    count: int = WORLDS
    seed: int = 0
    progress: Callable[[int, int], None] | None = None
    printed: Printed = field(default_factory=printed)

    @cached_property
    def base(self) -> World:
        """The world of the given assumptions."""
        return World(self.given, self.printed, fine=True)

    @cached_property
    def worlds(self) -> tuple[World, ...]:
        """The base, and random others."""
        others = random_worlds(self.count, self.seed, self.given, self.printed)
        return (self.base, *others)

    @cached_property
    def phase(self) -> dict[str, Any]:
        """Eq. 13's phase in the base world, as written and as meant."""
        return check_phase(self.base)

    @cached_property
    def steps(self) -> tuple[Step, ...]:
        """The life of the paper's task, by each correction of its method."""
        return waterfall(self.base)

    @cached_property
    def influences(self) -> tuple[Influence, ...]:
        """Of every unreported input on the life, the largest first."""
        return influences(self.given, self.printed)

    @cached_property
    def sequences(self) -> Sequences:
        """Worlds in which the joints dominate as Fig. 9 has it."""
        return find_sequences(self.given, self.seed, self.printed)

    @cached_property
    def curve_of_table(self) -> CurveOfTable:
        """Table 2's lives against its stresses, without an arm."""
        return curve_of_table(self.printed)

    @cached_property
    def comparison(self) -> Comparison:
        """The hypotheses of Table 2, with the arm."""
        return compare_hypotheses(self.printed, self.given, self.progress)

    @cached_property
    def fitted(self) -> World:
        """The world that comes nearest to Table 2's eight mean stresses."""
        fit = self.comparison.alike[0]
        values = decode(fit.vector[: len(FREE)])
        given = fit.place.base.but(**values, stress_per_twist=fit.stress_per_twist)
        return World(given, self.printed)
