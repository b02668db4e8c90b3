"""What explains Table 2, how certainly, and what remains unknown."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from picchio.core.arrays import FloatArray
from picchio.paper.table2.by_curve import OTHER_CURVE, CurveOfTable
from picchio.paper.table2.compare import Comparison
from picchio.paper.table2.fit import described
from picchio.paper.table2.place import FREE

if TYPE_CHECKING:
    from picchio.paper.study import Study


@dataclass(frozen=True, eq=False)
class Answer:
    """Table 2, ours beside the paper's, and what follows.

    Attributes:
        table: the entries against the curves; comparison: the hypotheses with the arm.
        base_stress: (3, 3) MPa, mean peaks in the base world; fitted_stress: in the fitted one.
        base_cycles: (3, 3) cycles of the printed curve at the base world's means.
        lead: how much better, in the criterion, the best is than the best that keeps the printed
            curve; by entries alone, and with the arm.
        crossing: (cycles, MPa) where the two curves meet.
        shared: b of the one times b of the other over their inverse: r^2 of a scatter of points of
            which they would be the two regression lines.
        ranges: of the unreported inputs among worlds that fit the means about as well.
    """

    table: CurveOfTable
    comparison: Comparison
    base_stress: FloatArray
    fitted_stress: FloatArray
    base_cycles: FloatArray
    lead: tuple[float, float]
    crossing: tuple[float, float]
    shared: float
    ranges: dict[str, tuple[float, float]]

    @property
    def slip(self) -> tuple[str, str, float]:
        """The change of one digit that comes nearest to the curve: to, from, ln N that is left."""
        curve = self.table.other
        k, a, b = curve.aside, curve.values["a"], curve.values["b"]
        assert k is not None
        stress, cycles = f"{self.table.stress[k]:.2f}", f"{self.table.cycles[k]:.2e}"
        trials = []
        for text in (stress, cycles):
            for other in _one_digit_off(text):
                s = float(other if text is stress else stress)
                n = float(other if text is cycles else cycles)
                trials.append((abs(math.log(n) - math.log(s / a) / b), other, text))
        off, other, text = min(trials)
        return other, text, off

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "base_mean_stress": self.base_stress,
            "base_cycles": self.base_cycles,
            "fitted_mean_stress": self.fitted_stress,
            "curve": self.table.other.to_dict(),
            "misprint": {
                "entry": self.table.misprint,
                "factor": self.table.misprint_factor,
                "nearest_digit": list(self.slip),
            },
            "lead": {"entries_alone": self.lead[0], "with_the_arm": self.lead[1]},
            "crossing": {"cycles": self.crossing[0], "stress": self.crossing[1]},
            "shared_variance": self.shared,
            "hypotheses": [h.to_dict() for h in self.comparison.hypotheses],
            "alike": {name: list(pair) for name, pair in self.ranges.items()},
        }


def _one_digit_off(text: str) -> list[str]:
    """The numbers whose mantissa differs from this one in one digit."""
    end = text.find("e") if "e" in text else len(text)
    found = [
        text[:i] + digit + text[i + 1 :]
        for i in range(end)
        if text[i].isdigit()
        for digit in "0123456789"
        if digit != text[i]
    ]
    return [other for other in found if float(other) > 0.0]


def answer(study: Study) -> Answer:
    """All that can be said of Table 2."""
    table, comparison = study.curve_of_table, study.comparison
    curve = table.other
    printed = study.printed.sn_curve
    keeps = [f for f in table.fits if f.name != OTHER_CURVE]
    kept = next(h for h in comparison.hypotheses if not h.fit.rule.free_exponent)
    lead = (min(f.bic for f in keeps) - curve.bic, kept.bic - comparison.hypotheses[0].bic)
    a, b = curve.values["a"], curve.values["b"]
    cycles = (a / printed.a) ** (1.0 / (printed.b - b))
    base = study.base.rivet_stress.mean(axis=1)
    near = [f for f in comparison.alike if f.cost < 2.0 * comparison.alike[0].cost]
    worlds = [described(f) for f in near]
    ranges = {
        name: (min(float(w[name]) for w in worlds), max(float(w[name]) for w in worlds))
        for name in (*FREE, "stress_per_twist")
    }
    return Answer(
        table, comparison, base, study.fitted.rivet_stress.mean(axis=1),
        printed.cycles(base), lead, (cycles, printed.a * cycles**printed.b),
        printed.b / b, ranges,
    )  # fmt: skip
