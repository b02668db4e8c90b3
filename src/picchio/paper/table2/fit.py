"""Fitting one hypothesis to Table 2: its means and its lives at once."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.paper.printed import Printed
from picchio.paper.table2.place import FREE, Place, decode, limits
from picchio.paper.table2.rules import Rule

_UNREACHABLE = 5.0
_EXPONENTS = (1.0, 8.0)
_STEP = 1.5e-8  # of a difference: the root of what a number is rounded to


@dataclass(frozen=True, eq=False)
class Target:
    """Table 2 as logarithms, with weights 1 and 0 for entries kept and left out.

    Attributes:
        printed: the paper.
        mean: (8,) and life: (8,), the weights.
    """

    printed: Printed
    mean: FloatArray = field(default_factory=lambda: np.ones(8))
    life: FloatArray = field(default_factory=lambda: np.ones(8))

    @property
    def finite(self) -> FloatArray:
        """(3, 3) where Table 2 has a stress at all."""
        return np.isfinite(self.printed.cycles)

    def without(self, kind: str, k: int) -> Target:
        """The same with one entry left out."""
        mean, life = self.mean.copy(), self.life.copy()
        (mean if kind == "mean" else life)[k] = 0.0
        return Target(self.printed, mean, life)


@dataclass(frozen=True, eq=False)
class Fit:
    """A hypothesis at its best.

    Attributes:
        rule: the hypothesis; place: what is not a number; vector: the numbers.
        mean_errors: (8,) ln of ours over the printed mean stress.
        life_errors: (8,) ln of ours over the printed N.
        cost: sum of squares of the entries kept.
        stress_per_twist: Pa, G r / l.
        exponent: of the S-N curve that was used or found.
    """

    rule: Rule
    place: Place
    vector: FloatArray
    mean_errors: FloatArray
    life_errors: FloatArray
    cost: float
    stress_per_twist: float
    exponent: float


def evaluate(
    rule: Rule, place: Place, v: FloatArray, target: Target, found: FloatArray | None = None
) -> Fit | None:
    """A hypothesis at given numbers; None where a rivet is out of reach.

    Args:
        rule: the hypothesis.
        place: what is not a number.
        v: the world; where the exponent is free, it is the last.
        target: Table 2.
        found: the deflections there, where they are known.
    """
    if found is None:
        found = place.deflections(v[: len(FREE)], target.printed)
    if np.isnan(found).any():
        return None
    printed, finite = target.printed, target.finite
    per_joint = np.moveaxis(found, 1, 2)[finite]  # (8, rivets)
    exponent = float(v[-1]) if rule.free_exponent else printed.sn_curve.exponent
    ln_mean = np.log(per_joint.mean(axis=-1) + 1e-15)
    ln_stress = np.log(printed.stress[finite])
    shift = float((target.mean * (ln_stress - ln_mean)).sum() / target.mean.sum())
    mean_errors = ln_mean + shift - ln_stress
    ln_cycles = np.log(printed.cycles[finite])
    # N ~ S^-m over what the rivets' spread adds to the damage at the mean.
    predicted = -exponent * ln_stress - rule.average(per_joint, exponent)
    if rule.counts is None:  # the curve's level is free
        level = float((target.life * (ln_cycles - predicted)).sum() / target.life.sum())
        predicted = predicted + level
    else:
        predicted = predicted + exponent * math.log(printed.sn_curve.a) - math.log(rule.counts)
    life_errors = predicted - ln_cycles
    cost = float((target.mean * mean_errors**2).sum() + (target.life * life_errors**2).sum())
    return Fit(rule, place, np.array(v), mean_errors, life_errors, cost,
               float(np.exp(shift) * 1e6), exponent)  # fmt: skip


def refine(rule: Rule, place: Place, start: FloatArray, target: Target, steps: int = 40) -> Fit:
    """The best fit near a start."""
    from scipy.optimize import least_squares

    low, high = limits()
    v = start[: len(FREE)]
    if rule.free_exponent:
        exponent = start[-1] if start.size > len(FREE) else target.printed.sn_curve.exponent
        v = np.append(v, exponent)
        low, high = np.append(low, _EXPONENTS[0]), np.append(high, _EXPONENTS[1])
    inner = 1e-6 * (high - low)
    v = np.clip(v, low + inner, high - inner)

    def residuals(x: FloatArray, found: FloatArray | None = None) -> FloatArray:
        fit = evaluate(rule, place, x, target, found)
        if fit is None:
            return np.full(16, _UNREACHABLE)
        return np.concatenate([target.mean * fit.mean_errors, target.life * fit.life_errors])

    def slopes(x: FloatArray) -> FloatArray:
        """By differences, of all worlds at once."""
        step = _STEP * np.maximum(1.0, np.abs(x))
        step = np.where(x + step > high, -step, step)
        near = np.vstack([x, x + np.diag(step)])
        there = place.deflections(near[:, : len(FREE)], target.printed)
        here, *others = (residuals(*each) for each in zip(near, there, strict=True))
        return np.transpose([(other - here) / h for other, h in zip(others, step, strict=True)])

    close = {"xtol": 1e-6, "ftol": 1e-6, "x_scale": "jac"}
    found = least_squares(residuals, v, slopes, bounds=(low, high), max_nfev=steps, **close)
    best = evaluate(rule, place, found.x, target)
    first = evaluate(rule, place, v, target)
    assert first is not None
    return first if best is None or best.cost > first.cost else best


def described(fit: Fit) -> dict[str, float | str | int]:
    """The fitted world, by name."""
    base = fit.place.base
    return {
        **decode(fit.vector[: len(FREE)]),
        "stress_per_twist": fit.stress_per_twist,
        "exponent": fit.exponent,
        "rows": base.rows,
        "columns": base.columns,
        "elbow": base.elbow,
        "inertia_about": base.inertia_about,
    }
