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
        set_aside: index of the entry set aside, or None.
        bic: Bayesian information criterion, less is better.
        left_out_median: of |ln error| of each entry predicted from the others.
    """

    name: str
    parameters: int
    values: dict[str, float]
    residuals: FloatArray
    set_aside: int | None
    bic: float
    left_out_median: float


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
        return next(f for f in self.fits if f.name == name and (f.set_aside is not None) == aside)

    @property
    def other(self) -> CurveFit:
        """Another curve than the printed one, through all entries but the one set aside."""
        return self.fit(OTHER_CURVE, aside=True)

    @property
    def aside(self) -> int:
        """Index of the entry that no curve through the others meets."""
        assert self.other.set_aside is not None
        return self.other.set_aside

    @property
    def misprint(self) -> str:
        """That entry."""
        return self.labels[self.aside]

    @property
    def misprint_factor(self) -> float:
        """How far it is off."""
        return math.exp(abs(float(self.other.residuals[self.aside])))

    @property
    def within(self) -> float:
        """Largest relative error of the other entries on the other curve, in per cent."""
        return 100 * float(np.abs(np.delete(self.other.residuals, self.aside)).max())


Hypothesis = Callable[[FloatArray, FloatArray], tuple[FloatArray, dict[str, float]]]


def hypotheses(printed: Printed) -> dict[str, Hypothesis]:
    """What ln N may be at a stress: by name, a fit.

    A fit takes ln S and ln N and gives a polynomial in ln S and the fitted values by name.
    """
    m, level = printed.sn_curve.exponent, printed.sn_curve.exponent * math.log(printed.sn_curve.a)
    hits = math.log(printed.task.hits_per_rivet)

    def factor(s: FloatArray, n: FloatArray) -> tuple[FloatArray, dict[str, float]]:
        shift = float((level - m * s - n).mean())
        return np.array([-m, level - shift]), {"factor": math.exp(shift)}

    def other(s: FloatArray, n: FloatArray) -> tuple[FloatArray, dict[str, float]]:
        slope, start = np.polyfit(s, n, 1)
        values = {"a": math.exp(-start / slope), "b": 1.0 / slope, "exponent": -slope}
        return np.array([slope, start]), values

    return {
        "the curve as printed": lambda s, n: (np.array([-m, level]), {}),
        "as printed, rivets for hits": lambda s, n: (np.array([-m, level - hits]), {}),
        "as printed, times a factor": factor,
        OTHER_CURVE: other,
    }


_PARAMETERS = (0, 0, 1, 2)  # that each of them fits


def curve_of_table(printed: Printed) -> CurveOfTable:
    """Compare the hypotheses on Table 2's eight finite entries."""
    finite = np.isfinite(printed.cycles)
    labels = tuple(f"{printed.table2[d].direction}, joint {j + 1}" for d, j in np.argwhere(finite))
    stress, cycles = printed.stress[finite], printed.cycles[finite]
    rounding = rounding_of(stress, cycles, printed.sn_curve.exponent)
    entries = np.array([np.log(stress), np.log(cycles), rounding])
    fits = [
        _fit(name, count, fit, entries, aside)
        for (name, fit), count in zip(hypotheses(printed).items(), _PARAMETERS, strict=True)
        for aside in (False, True)
    ]
    over, best_first = printed.sn_curve.cycles(stress) / cycles, sorted(fits, key=lambda f: f.bic)
    return CurveOfTable(stress, cycles, labels, over, tuple(best_first), rounding)


def rounding_of(stress: FloatArray, cycles: FloatArray, exponent: float) -> FloatArray:
    """Largest |ln N| error by rounding N to three digits and S to 0.01 MPa."""
    digit = 10.0 ** (np.floor(np.log10(cycles)) - 2)
    return np.asarray(0.5 * digit / cycles + exponent * 0.005 / stress)


def _fit(name: str, count: int, fit: Hypothesis, entries: FloatArray, aside: bool) -> CurveFit:
    """A hypothesis on entries (3, 8): ln S, ln N, and the error that rounding can make."""
    s, n, rounding = entries
    every = np.arange(s.size)

    def off(kept: FloatArray) -> FloatArray:
        return n - np.polyval(fit(s[kept], n[kept])[0], s)

    def cost(out: int) -> float:
        rest = np.delete(every, out)
        return float((off(rest)[rest] ** 2).sum())

    gone = min(map(int, every), key=cost) if aside else None
    kept = every if gone is None else np.delete(every, gone)
    residuals = off(kept)
    # A rounded number is uniform within its half digit; the least error beyond that is likeliest.
    beyond = np.concatenate([[0.0], np.geomspace(1e-5, 10.0, 400)])[:, None]
    variance = rounding[kept] ** 2 / 3.0 + beyond**2
    likelihood = residuals[kept] ** 2 / variance + np.log(2.0 * math.pi * variance)
    minus2 = float(likelihood.sum(axis=1).min())
    if gone is not None:  # it is off by anything up to `_OUT` either way
        minus2 += 2.0 * math.log(2.0 * _OUT)
    left_out = float(np.median([abs(off(kept[kept != k])[k]) for k in kept]))
    bic = minus2 + penalty(count + aside + 1, s.size)
    values = fit(s[kept], n[kept])[1]
    return CurveFit(name, count + aside, values, residuals, gone, bic, left_out)


def penalty(parameters: int, entries: int) -> float:
    """Of the Bayesian information criterion (Schwarz 1978)."""
    return parameters * math.log(entries)


def one_digit_off(curve: CurveOfTable) -> tuple[str, str, float]:
    """The change of one digit that comes nearest to the curve: to, from, ln N that is left."""
    a, b = curve.other.values["a"], curve.other.values["b"]
    stress, cycles = f"{curve.stress[curve.aside]:.2f}", f"{curve.cycles[curve.aside]:.2e}"
    trials = []
    for text in (stress, cycles):
        for i, old in enumerate(text.partition("e")[0]):
            for new in "0123456789":
                other = text[:i] + new + text[i + 1 :]
                if old.isdigit() and new != old and float(other) > 0.0:
                    s = float(other if text is stress else stress)
                    n = float(other if text is cycles else cycles)
                    trials.append((abs(math.log(n) - math.log(s / a) / b), other, text))
    off, other, text = min(trials)
    return other, text, off
