"""Table 2 with the arm: nine hypotheses from 15 rivets' stresses to a joint's N.

Each is fitted to the eight mean stresses and the eight lives at once, with the same eight
unreported inputs free; the ninth number, the stress per twist, is solved for. They are compared
by the Bayesian information criterion and by entries left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.excitation.pulse_train import PulseTrain
from picchio.paper.equations import printed_series
from picchio.paper.printed import Printed
from picchio.paper.table2.by_curve import penalty, rounding_of
from picchio.paper.world import Assumptions, arm, poses_at, rivet_points
from picchio.robot.flexible_robot import FlexibleRobot

BOUNDS = {
    "period": (0.02, 0.3),
    "duty": (0.02, 0.5),
    "damping_ratio": (0.003, 0.15),
    "panel_x": (0.3, 1.45),
    "panel_y": (-0.1, 1.0),
    "panel_z": (-0.3, 1.8),
    "pitch": (0.02, 0.35),
}
"""What is fitted with every hypothesis, and between which limits, SI."""
FREE = tuple(BOUNDS)
_LOG = ("period", "duty", "damping_ratio", "pitch")
_EXPONENTS = (1.0, 8.0)  # of an S-N curve that is fitted
_SAMPLES = 128  # of a period
_TRIED, _STARTED, _PARTS = 1500, 14, 10  # worlds, fits, and parts that fit into a cache
_ROUGH, _FINE, _AGAIN = 20, 60, 8  # steps of a fit
_UNREACHABLE, _STEP = 5.0, 1.5e-8  # ln; of a difference: the root of what a number is rounded to

Average = Callable[[FloatArray, float], FloatArray]


def at_mean(stress: FloatArray, exponent: float) -> FloatArray:
    """Every rivet counts with the mean of the peaks: what the text says. (..., rivets) in."""
    return np.zeros(stress.shape[:-1])


def by_miner(stress: FloatArray, exponent: float) -> FloatArray:
    """Each rivet counts with its own life; ln of the damage over that at the mean."""
    relative = stress / stress.mean(axis=-1, keepdims=True)
    return np.asarray(np.log((relative**exponent).mean(axis=-1)))


def at_worst(stress: FloatArray, exponent: float) -> FloatArray:
    """All rivets count like the worst one."""
    return np.asarray(exponent * np.log(stress.max(axis=-1) / stress.mean(axis=-1)))


@dataclass(frozen=True)
class Rule:
    """One hypothesis.

    Attributes:
        name: in words.
        average: how 15 rivets become one damage.
        counts: what N is divided by: 1 (hits), the hits of a rivet, or None for any factor.
        free_exponent: whether the curve's exponent is fitted, and its level with it.
        measure: stress "peak" or "range".
        inertia_about: "cg" or "joint".
    """

    name: str
    average: Average
    counts: float | None
    free_exponent: bool = False
    measure: str = "peak"
    inertia_about: str = "cg"

    @property
    def extra(self) -> int:
        """Numbers fitted beside the world's."""
        return int(self.free_exponent) + int(self.counts is None)


def rules(hits: float) -> list[Rule]:
    """The hypotheses, the paper's own words first. Add one here."""
    about: Any = {"inertia_about": "joint"}
    other = "another curve, at the mean"
    return [
        Rule("curve as printed, at the mean stress", at_mean, 1.0),
        Rule("rivets for hits, at the mean stress", at_mean, hits),
        Rule("rivets for hits, Miner over the rivets", by_miner, hits),
        Rule("rivets for hits, the worst rivet", at_worst, hits),
        Rule("rivets for hits, Miner, range for peak", by_miner, hits, measure="range"),
        Rule("rivets for hits, Miner, inertias about the joints", by_miner, hits, **about),
        Rule("another exponent, Miner over the rivets", by_miner, None, True),
        Rule(f"{other} stress", at_mean, None, True),
        Rule(f"{other}, inertias about the joints", at_mean, None, True, **about),
    ]


@dataclass(frozen=True)
class Place:
    """The choices that are not numbers: rows, elbow, the inertias' point, peak or range.

    Attributes:
        base: gives rows, columns, elbow and `inertia_about`, and what is not fitted.
        measure: of a steady state: its "peak", or its "range" from trough to crest.
    """

    base: Assumptions
    measure: str = "peak"

    @cached_property
    def robot(self) -> FlexibleRobot:
        """The arm; its damping and shafts are not used here."""
        return arm(self.base)

    def deflections(self, v: FloatArray, printed: Printed) -> FloatArray:
        """The deflections (..., 3 directions, k rivets, 3 joints), rad; NaN where out of reach.

        Args:
            v: (..., unknowns) of the fit: many worlds at once take little longer than one.
            printed: what the paper prints.
        """
        worlds = [self.base.but(**decode(x)) for x in v.reshape(-1, v.shape[-1])]
        poses = poses_at(np.array([rivet_points(given) for given in worlds]), self.base.elbow)
        within = ~np.isnan(poses).any(axis=(1, 2))
        rivets, joints = poses.shape[1:]
        found = np.full((len(worlds), len(printed.directions), rivets, joints), np.nan)
        if within.any():
            mass, jacobian = self.robot.mass_and_jacobian(poses[within].reshape(-1, joints))
            reached = [worlds[k] for k in np.flatnonzero(within)]
            mass = mass.reshape(-1, rivets, joints, joints)
            jacobian = jacobian.reshape(-1, rivets, 3, joints)
            ratios = np.array([given.damping_ratio for given in reached])
            blows = [PulseTrain(printed.task.force, g.period, g.width) for g in reached]
            own = (self.robot.stiffness, ratios, blows, printed.directions)
            peak, span = steady_extremes(mass, jacobian, *own)
            found[within] = peak if self.measure == "peak" else span
        return found.reshape(*v.shape[:-1], *found.shape[1:])


def encode(values: dict[str, float]) -> FloatArray:
    """A vector from values by name; sizes as logarithms."""
    return np.array([np.log(values[n]) if n in _LOG else values[n] for n in FREE])


def decode(v: FloatArray) -> dict[str, float]:
    """Values by name from a vector."""
    return {n: float(np.exp(x) if n in _LOG else x) for n, x in zip(FREE, v, strict=True)}


def limits() -> tuple[FloatArray, FloatArray]:
    """The least and the largest vector."""
    low, high = (encode({name: pair[k] for name, pair in BOUNDS.items()}) for k in (0, 1))
    return low, high


def steady_extremes(
    mass: FloatArray,
    jacobian: FloatArray,
    stiffness: FloatArray,
    damping_ratio: FloatArray,
    blows: Sequence[PulseTrain],
    directions: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Peak and range of the steady state by a Fourier sum: to 1 in 1000, for many trials.

    Args:
        mass: (w worlds, k, n, n).
        jacobian: (w, k, 3, n).
        stiffness: (n,).
        damping_ratio: (w,) of every mode.
        blows: w; the pulses.
        directions: (d, 3).

    Returns:
        largest magnitude, and crest less trough, each (w, d, k, n) rad.
    """
    root = np.linalg.inv(np.linalg.cholesky(mass))
    squared, vectors = np.linalg.eigh((root * stiffness) @ root.swapaxes(-1, -2))
    shapes = root.swapaxes(-1, -2) @ vectors
    push = directions @ (jacobian @ shapes)  # (w, k, d, modes)
    period = np.array([each.period for each in blows])
    wave = 2.0 * np.pi / period[:, None] * np.arange(_SAMPLES // 2)
    force = np.array([printed_series(each, _SAMPLES // 2 - 1) for each in blows])
    force[:, 1:] /= 2.0  # the other half is at the negative frequencies
    wave, force = wave[:, None, None], force[:, None, None]
    ratio = np.asarray(damping_ratio)[:, None, None, None]
    gap = squared[..., None] - wave**2
    modal = force / (gap + (2j * ratio) * np.sqrt(squared)[..., None] * wave)
    history = np.fft.irfft(modal, n=_SAMPLES, axis=-1) * _SAMPLES  # (w, k, modes, samples)
    mixed = shapes[..., None, :, :] * push[..., None, :]  # (w, k, d, joints, modes)
    found = np.matmul(mixed.reshape(*mass.shape[:2], -1, len(stiffness)), history)
    high, low = _crest(found), -_crest(-found)
    shape = (*mass.shape[:2], len(directions), len(stiffness))
    peak = np.maximum(np.abs(high), np.abs(low)).reshape(shape)
    return np.moveaxis(peak, 2, 1), np.moveaxis((high - low).reshape(shape), 2, 1)


def _crest(history: FloatArray) -> FloatArray:
    """The top of the parabola through the highest sample and its neighbours."""
    top = history.argmax(axis=-1)[..., None]
    before, here, after = (
        np.take_along_axis(history, (top + step) % _SAMPLES, axis=-1)[..., 0] for step in (-1, 0, 1)
    )
    bend = 2.0 * here - before - after
    rise = (after - before) ** 2 / 8.0
    return np.asarray(here + np.divide(rise, bend, out=np.zeros_like(here), where=bend > 0.0))


@dataclass(frozen=True, eq=False)
class Target:
    """Table 2 as logarithms, with weights 1 and 0 for entries kept and left out.

    Attributes:
        printed: the paper.
        weights: (2, 8), of the means and of the lives.
    """

    printed: Printed
    weights: FloatArray = field(default_factory=lambda: np.ones((2, 8)))

    @property
    def finite(self) -> FloatArray:
        """(3, 3) where Table 2 has a stress at all."""
        return np.isfinite(self.printed.cycles)

    def without(self, kind: int, k: int) -> Target:
        """The same with one mean (kind 0) or one life (kind 1) left out."""
        weights = self.weights.copy()
        weights[kind, k] = 0.0
        return Target(self.printed, weights)


@dataclass(frozen=True, eq=False)
class Fit:
    """A hypothesis at its best.

    Attributes:
        rule: the hypothesis; place: what is not a number; vector: the numbers.
        errors: (2, 8) ln of ours over the printed mean stress, and over the printed N.
        cost: sum of squares of the entries kept.
        stress_per_twist: Pa, G r / l.
        exponent: of the S-N curve that was used or found.
    """

    rule: Rule
    place: Place
    vector: FloatArray
    errors: FloatArray
    cost: float
    stress_per_twist: float
    exponent: float

    @property
    def world(self) -> dict[str, float | str | int]:
        """The fitted world, by name."""
        found = {"stress_per_twist": self.stress_per_twist, "exponent": self.exponent}
        names = ("rows", "columns", "elbow", "inertia_about")
        chosen = {name: getattr(self.place.base, name) for name in names}
        return {**decode(self.vector[: len(FREE)]), **found, **chosen}


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
    curve, finite, (mean, life) = target.printed.sn_curve, target.finite, target.weights
    per_joint = np.moveaxis(found, 1, 2)[finite]  # (8, rivets)
    exponent = float(v[-1]) if rule.free_exponent else curve.exponent
    ln_mean = np.log(per_joint.mean(axis=-1) + 1e-15)
    ln_stress, ln_cycles = (
        np.log(a[finite]) for a in (target.printed.stress, target.printed.cycles)
    )
    shift = float((mean * (ln_stress - ln_mean)).sum() / mean.sum())
    # N ~ S^-m over what the rivets' spread adds to the damage at the mean.
    predicted = -exponent * ln_stress - rule.average(per_joint, exponent)
    if rule.counts is None:  # the curve's level is free
        predicted = predicted + float((life * (ln_cycles - predicted)).sum() / life.sum())
    else:
        predicted = predicted + exponent * math.log(curve.a) - math.log(rule.counts)
    errors = np.array([ln_mean + shift - ln_stress, predicted - ln_cycles])
    cost = float((mean * errors[0] ** 2).sum() + (life * errors[1] ** 2).sum())
    return Fit(rule, place, np.array(v), errors, cost, float(np.exp(shift) * 1e6), exponent)


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
        return np.full(16, _UNREACHABLE) if fit is None else (target.weights * fit.errors).ravel()

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


@dataclass(frozen=True, eq=False)
class Compared:
    """A hypothesis, how well it fits and predicts.

    Attributes:
        fit: to all entries but the one aside.
        set_aside: index of the life set aside as a misprint, or None.
        parameters: numbers fitted, the world's included.
        bic: Bayesian information criterion; less is better.
        left_out: (2, 8) ln error of each mean and each life, predicted from the other entries.
    """

    fit: Fit
    set_aside: int | None
    parameters: int
    bic: float
    left_out: FloatArray

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        own = {name: getattr(self, name) for name in ("parameters", "set_aside", "bic")}
        errors = dict(zip(("mean_errors", "life_errors"), self.fit.errors, strict=True))
        left_out = dict(zip(("left_out_mean", "left_out_life"), self.left_out, strict=True))
        return {"name": self.fit.rule.name, **own, **errors, **left_out, "world": self.fit.world}


@dataclass(frozen=True, eq=False)
class Comparison:
    """All hypotheses, best first; and other worlds that give the same means.

    Attributes:
        hypotheses: best first.
        alike: worlds that come about as near to the eight means as the best does.
    """

    hypotheses: tuple[Compared, ...]
    alike: tuple[Fit, ...]


Trial = tuple[Place, FloatArray, FloatArray]


def compare_hypotheses(
    printed: Printed, given: Assumptions, progress: Callable[[int, int], None] | None = None
) -> Comparison:
    """Fit every hypothesis with the same freedom and compare."""
    every, target = rules(printed.task.hits_per_rivet), Target(printed)
    families: dict[tuple[str, str], list[Trial]] = {}
    found = []
    for k, rule in enumerate(every):
        family = (rule.measure, rule.inertia_about)
        if family not in families:
            families[family] = _trials(rule, given, printed)
        found.append(_compare(rule, families[family], target))
        if progress is not None:
            progress(k + 1, len(every))
    means = Rule("means alone", at_mean, None)
    blank = Target(printed, np.array([np.ones(8), np.full(8, 1e-9)]))
    alike = _starts(means, families[("peak", "cg")], blank)
    return Comparison(tuple(sorted(found, key=lambda c: c.bic)), tuple(alike))


def _trials(rule: Rule, given: Assumptions, printed: Printed) -> list[Trial]:
    """Random worlds with their deflections, for all rules that look at the same quantity."""
    rng = np.random.default_rng(0)
    low, high = limits()
    trials = []
    for (r, c), elbow in product(((3, 5), (5, 3)), ("down", "up")):
        base = given.but(rows=r, columns=c, elbow=elbow, inertia_about=rule.inertia_about)
        place = Place(base, rule.measure)
        for few in np.array_split(rng.random((_TRIED, len(FREE))), _PARTS):
            vectors = low + (high - low) * few
            every = zip(vectors, place.deflections(vectors, printed), strict=True)
            trials += [(place, v, found) for v, found in every if not np.isnan(found).any()]
    return trials


def _starts(rule: Rule, trials: list[Trial], target: Target) -> list[Fit]:
    """The trials that suit a rule best, refined; best first."""
    own = np.array([target.printed.sn_curve.exponent] if rule.free_exponent else [])
    tried = (evaluate(rule, place, np.append(v, own), target, found) for place, v, found in trials)
    scored = sorted((fit for fit in tried if fit is not None), key=lambda f: f.cost)
    fits = [refine(rule, f.place, f.vector, target, _ROUGH) for f in scored[:_STARTED]]
    return sorted(fits, key=lambda f: f.cost)


def _compare(rule: Rule, trials: list[Trial], target: Target) -> Compared:
    first = _starts(rule, trials, target)[0]
    plain = refine(rule, first.place, first.vector, target, _FINE)
    worst = int(np.abs(plain.errors[1]).argmax())
    # One life may be a misprint, at the cost of a parameter.
    part = target.without(1, worst)
    aside = refine(rule, plain.place, plain.vector, part, _FINE)
    counts = len(FREE) + 1 + rule.extra
    scored = [
        (_bic(plain, target, counts), plain, None, counts, target),
        (_bic(aside, part, counts + 1), aside, worst, counts + 1, part),
    ]
    value, fit, out, parameters, kept = min(scored, key=lambda s: s[0])
    left_out = np.full((2, 8), np.nan)
    for kind, k in np.argwhere(kept.weights):
        again = refine(fit.rule, fit.place, fit.vector, kept.without(kind, k), _AGAIN)
        left_out[kind, k] = again.errors[kind, k]
    return Compared(fit, out, parameters, value, left_out)


def _bic(fit: Fit, target: Target, parameters: int) -> float:
    """One error for the means and one for the lives, neither smaller than rounding."""
    stress, cycles = (a[target.finite] for a in (target.printed.stress, target.printed.cycles))
    rounding = (0.005 / stress, rounding_of(stress, cycles, fit.exponent))
    total = penalty(parameters + 2, 16)
    for errors, weight, least in zip(fit.errors, target.weights, rounding, strict=True):
        count = float(weight.sum())
        variance = float((weight * errors**2).sum()) / count + float((least**2).mean()) / 3.0
        total += count * (math.log(2.0 * math.pi * variance) + 1.0)
        # A misprint may be anywhere within ln ± 3.
        total += 2.0 * math.log(6.0) * (len(weight) - count)
    return total
