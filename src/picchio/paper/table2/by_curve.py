"""Table 2 without an arm: how its lives follow from its own mean stresses.

Each hypothesis predicts ln N from the printed stress S. They are compared by the Bayesian
information criterion, with the rounding of the printed numbers as the least error there can be,
and by how well they predict an entry that was left out. Each may also set one entry aside as a
misprint, at the cost of a parameter.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.paper.printed import Printed

OTHER_CURVE = "another curve S = a N^b"
_OUT = 3.0  # ln; what a misprint may be off by


@dataclass(frozen=True)
class CurveFit:
    """One hypothesis, fitted to Table 2's (S, N).

    Attributes:
        name: of the hypothesis.
        parameters: how many numbers were fitted, the misprint included, the error not.
        values: them.
        residuals: (8,) ln of printed over predicted N.
        aside: index of the entry set aside, or None.
        error: standard deviation of ln N beyond rounding.
        bic: Bayesian information criterion, less is better.
        left_out: (8,) ln error of each entry predicted from the others; NaN for the one aside.
    """

    name: str
    parameters: int
    values: dict[str, float]
    residuals: FloatArray
    aside: int | None
    error: float
    bic: float
    left_out: FloatArray

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "name": self.name,
            "parameters": self.parameters,
            "values": self.values,
            "residuals": self.residuals,
            "set_aside": self.aside,
            "bic": self.bic,
            "left_out_median": float(np.nanmedian(np.abs(self.left_out))),
        }


@dataclass(frozen=True)
class CurveOfTable:
    """All of it.

    Attributes:
        stress: (8,) MPa and cycles: (8,), Table 2's finite entries, row by row.
        labels: of the entries.
        over_printed: (8,) the printed curve's N over the printed N.
        fits: the hypotheses, best first.
        rounding: (8,) the largest |ln N| error that rounding can make.
    """

    stress: FloatArray
    cycles: FloatArray
    labels: tuple[str, ...]
    over_printed: FloatArray
    fits: tuple[CurveFit, ...]
    rounding: FloatArray

    def fit(self, name: str, aside: bool = False) -> CurveFit:
        """A hypothesis by its name, with or without an entry aside.

        Args:
            name: of the hypothesis.
            aside: whether an entry of the table is left out.
        """
        return next(f for f in self.fits if f.name == name and (f.aside is not None) == aside)

    @property
    def other(self) -> CurveFit:
        """Another curve than the printed one, through all entries but the one set aside."""
        return self.fit(OTHER_CURVE, aside=True)

    @property
    def misprint(self) -> str:
        """The entry that no curve through the others meets."""
        assert self.other.aside is not None
        return self.labels[self.other.aside]

    @property
    def misprint_factor(self) -> float:
        """How far it is off."""
        assert self.other.aside is not None
        return math.exp(abs(float(self.other.residuals[self.other.aside])))

    @property
    def within(self) -> float:
        """Largest relative error of the entries on the other curve."""
        assert self.other.aside is not None
        return float(np.abs(np.delete(self.other.residuals, self.other.aside)).max())


Hypothesis = tuple[
    str, int, Callable[[FloatArray, FloatArray], tuple[FloatArray, dict[str, float]]]
]


def hypotheses(printed: Printed) -> list[Hypothesis]:
    """What ln N may be at a stress: each a name, its parameters, and its fit.

    A fit takes ln S and ln N and gives a polynomial in ln S and the fitted values by name.
    """
    m, level = printed.sn_curve.exponent, printed.sn_curve.exponent * math.log(printed.sn_curve.a)
    hits = math.log(printed.task.hits_per_rivet)

    def factor(s: FloatArray, n: FloatArray) -> tuple[FloatArray, dict[str, float]]:
        shift = float((level - m * s - n).mean())
        return np.array([-m, level - shift]), {"factor": math.exp(shift)}

    def strength(s: FloatArray, n: FloatArray) -> tuple[FloatArray, dict[str, float]]:
        slope, start = np.polyfit(s, n, 1)
        return np.array([slope, start]), {
            "a": math.exp(-start / slope), "b": 1.0 / slope, "exponent": -slope,
        }  # fmt: skip

    return [
        ("the curve as printed", 0, lambda s, n: (np.array([-m, level]), {})),
        ("as printed, rivets for hits", 0, lambda s, n: (np.array([-m, level - hits]), {})),
        ("as printed, times a factor", 1, factor),
        (OTHER_CURVE, 2, strength),
    ]


def curve_of_table(printed: Printed) -> CurveOfTable:
    """Compare the hypotheses on Table 2's eight finite entries."""
    stress, cycles = printed.stress, printed.cycles
    finite = np.isfinite(cycles)
    labels = tuple(
        f"{row.direction}, joint {j + 1}"
        for row, ok in zip(printed.table2, finite, strict=True)
        for j in range(3)
        if ok[j]
    )
    s, n = np.log(stress[finite]), np.log(cycles[finite])
    rounding = rounding_of(stress[finite], cycles[finite], printed.sn_curve.exponent)
    fits = [
        _fit(entry, s, n, rounding, aside)
        for entry in hypotheses(printed)
        for aside in (False, True)
    ]
    return CurveOfTable(
        stress[finite], cycles[finite], labels,
        printed.sn_curve.cycles(stress[finite]) / cycles[finite],
        tuple(sorted(fits, key=lambda f: f.bic)), rounding,
    )  # fmt: skip


def rounding_of(stress: FloatArray, cycles: FloatArray, exponent: float) -> FloatArray:
    """Largest |ln N| error by rounding N to three digits and S to 0.01 MPa."""
    digit = 10.0 ** (np.floor(np.log10(cycles)) - 2)
    return np.asarray(0.5 * digit / cycles + exponent * 0.005 / stress)


def _fit(
    hypothesis: Hypothesis, s: FloatArray, n: FloatArray, rounding: FloatArray, aside: bool
) -> CurveFit:
    name, count, fit = hypothesis
    every = np.arange(s.size)

    def cost(out: int) -> float:
        rest = np.delete(every, out)
        line, _ = fit(s[rest], n[rest])
        return float(((n - np.polyval(line, s))[rest] ** 2).sum())

    gone = min(map(int, every), key=cost) if aside else None
    kept = every if gone is None else np.delete(every, gone)
    line, values = fit(s[kept], n[kept])
    residuals = n - np.polyval(line, s)
    # A rounded number is uniform within its half digit.
    known = rounding[kept] ** 2 / 3.0
    error = likely_error(residuals[kept], known)
    minus2 = minus_two_ln_likelihood(residuals[kept], known + error**2)
    if gone is not None:
        # The misprint is off by anything up to `_OUT` either way.
        minus2 += 2.0 * math.log(2.0 * _OUT)
    parameters = count + aside
    left_out = np.full(s.size, np.nan)
    for k in kept:
        rest = kept[kept != k]
        left_out[k] = n[k] - np.polyval(fit(s[rest], n[rest])[0], s[k])
    return CurveFit(name, parameters, values, residuals, gone, error,
                    minus2 + penalty(parameters + 1, s.size), left_out)  # fmt: skip


def likely_error(residuals: FloatArray, known: FloatArray) -> float:
    """The standard deviation, beyond a known variance, that makes residuals most likely."""
    trials = np.concatenate([[0.0], np.geomspace(1e-5, 10.0, 400)])
    costs = [minus_two_ln_likelihood(residuals, known + t**2) for t in trials]
    return float(trials[int(np.argmin(costs))])


def minus_two_ln_likelihood(residuals: FloatArray, variance: FloatArray) -> float:
    """Of independent normal residuals."""
    return float((residuals**2 / variance + np.log(2.0 * math.pi * variance)).sum())


def penalty(parameters: int, entries: int) -> float:
    """Of the Bayesian information criterion (Schwarz 1978)."""
    return parameters * math.log(entries)
