"""What is told of a fit: the causes' values, how sure they are, and the nuisances."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.diagnosis.percussion.criteria.equivalence import bic, confidence
from picchio.diagnosis.percussion.criteria.identifiability import unconstrained_range
from picchio.diagnosis.percussion.criteria.pose_consistency import jackknife_covariance
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.fit.drawn import width_spread
from picchio.diagnosis.percussion.fit.least_squares import Fit
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.search.state import EXACT, Search, Trial
from picchio.diagnosis.result import Cause, Correlation, Value, unit_of
from picchio.model.effects.effect import CHANNEL_UNIT, Effect


def fitted_causes(
    search: Search, whole: Fit, rivals: Sequence[Trial], refuted: Sequence[Trial] = ()
) -> tuple[Cause, ...]:
    """The causes with their values, spreads and confidence.

    The spread is that of the fit, larger where more than noise is left, and that of the model; at
    least as far as a value may go before chi-square changes by one.

    Args:
        search: the way there.
        whole: the fit to all records.
        rivals: other sets, fitted to the records of the search.
        refuted: rivals that only the records held out told apart, fitted to all.
    """
    unsettled = {trial.fit.hypothesis.labels for trial in refuted}
    rivals = [r for r in rivals if r.fit.hypothesis.labels not in unsettled]
    tolerated = search.problem.campaign.tolerance.model_dump()
    return tuple(
        Cause(
            effect.name,
            effect.target,
            _confidence(search, rivals, effect, whole, refuted),
            fitted_values(search.problem, whole, effect),
            effect.tolerances(tolerated),
        )
        for effect in whole.hypothesis.causes
    )


def fitted_values(problem: Problem, whole: Fit, effect: Effect) -> dict[str, Value]:
    """A cause's parameters in a fit to all records, with their standard deviations."""
    variance = reported_covariance(whole).diagonal()
    unknowns, vector = whole.hypothesis.unknowns(), whole.hypothesis.vector()
    index = whole.hypothesis.effects.index(effect)
    values = {}
    for p in effect.parameters:
        std = 0.0
        for k, unknown in enumerate(unknowns):
            if unknown.effect == index and unknown.name == p.name:
                std = abs(unknown.slope(vector[k])) * math.sqrt(max(variance[k], 0.0))
                std = max(std, _unconstrained(problem, whole, k))
        if effect.latent is not None and p.name == effect.latent.spread:
            drawn = {label: (fall, count) for label, fall, count in whole.hypothesis.drawn}
            std = 0.0
            if effect.label in drawn:
                std = width_spread(effect.values[p.name], *drawn[effect.label])
        values[p.name] = Value(effect.values[p.name], std, _unit(whole, effect, p.name))
    return values


def _unconstrained(problem: Problem, whole: Fit, number: int) -> float:
    """As `unconstrained_range`, in the parameter's unit; 0 for what is known beforehand."""
    unknown, here = whole.hypothesis.unknowns()[number], float(whole.hypothesis.vector()[number])
    if unknown.prior is not None:
        return 0.0
    moved = here + unconstrained_range(problem, whole, number)
    return abs(unknown.value(moved) - unknown.value(here))


def _unit(whole: Fit, effect: Effect, parameter: str) -> str:
    """The unit of a parameter; a sensor's range is in the unit that the sensor reads."""
    unit = effect.unit(parameter)
    if unit != CHANNEL_UNIT:
        return unit
    for record in whole.records:
        for channel in record.setup.channels:
            if channel.group == effect.target and channel.name in record.noise:
                return record.noise[channel.name].unit
    return "1"


def reported_covariance(whole: Fit) -> FloatArray:
    """(unknowns, unknowns) of the transformed unknowns, as it is told.

    That of the fit, larger where more than noise is left: by how much more, and by how far the
    poses then disagree. And that of the model's exactness.
    """
    inflate = max(1.0, whole.chi_square / max(whole.samples, 1))
    covariance = whole.covariance() * inflate + (1.0 - 1.0 / inflate) * jackknife_covariance(whole)
    hypothesis, vector = whole.hypothesis, whole.hypothesis.vector()
    for k, unknown in enumerate(hypothesis.unknowns()):
        effect = hypothesis.effects[unknown.effect]
        if effect.label in hypothesis.labels and covariance[k, k] > 0.0:
            neutral = next(p.neutral for p in effect.parameters if p.name == unknown.name)
            slope = abs(unknown.slope(vector[k]))
            # What the forward model's own inexactness leaves open: a share of the effect's size.
            from_neutral = effect.values[unknown.name] - (
                neutral if math.isfinite(neutral) else 0.0
            )
            left = EXACT * abs(from_neutral)
            covariance[k, k] += (left / slope) ** 2 if slope > 0.0 else 0.0
    return covariance


def fitted_correlation(whole: Fit) -> Correlation:
    """How all values of a fit hang together, nuisances included.

    Args:
        whole: the fit to all records.

    Returns:
        correlation coefficients by effect, target and parameter.
    """
    effects = whole.hypothesis.effects
    unknowns = [(effects[u.effect], u.name) for u in whole.hypothesis.unknowns()]
    names = [(effect.name, effect.target, name) for effect, name in unknowns]
    return Correlation.of(names, reported_covariance(whole))


def _confidence(
    search: Search,
    rivals: Sequence[Trial],
    effect: Effect,
    whole: Fit,
    refuted: Sequence[Trial],
) -> float:
    """From the poses' score differences to the best rival, and their spread (Student's t)."""
    best = search.best
    told = [
        confidence(whole, r.fit) for r in refuted if effect.label not in r.fit.hypothesis.labels
    ]
    others = [
        r.fit
        for r in rivals
        if effect.label not in r.fit.hypothesis.labels and r.finished(best.records)
    ]
    if others:
        told.append(confidence(best, min(others, key=bic)))
    if not told and len(best.hypothesis.causes) == 1 and search.baseline is not best:
        return confidence(best, search.baseline)
    if not told:
        return 0.5 if len(search.records) < 3 else 1.0
    return min(told)


def nuisance_name(effect: Effect) -> str:
    """What a nuisance is called: by its key of `[tolerance]`, where no sensor shares that.

    Args:
        effect: a nuisance.
    """
    if effect.tolerance == "stiffness":
        return f"stiffness.{effect.target}"
    return effect.name if effect.tolerance == "sensor_gain" else effect.tolerance


def fitted_nuisances(found: Fit) -> dict[str, Value]:
    """Fitted nuisances, in their own units; less sure where more than noise is left."""
    if found.jacobians is None:
        return {}
    covariance = reported_covariance(found)
    unknowns, vector = found.hypothesis.unknowns(), found.hypothesis.vector()
    robot = found.records[0].setup.geometry.robot
    nominal = dict(zip(robot.flexible_names, robot.stiffness, strict=True))
    ratio = float(np.mean(robot.damping_ratio))
    force = float(np.abs(found.records[0].setup.blows.height).max())
    result = {}
    for k, unknown in enumerate(unknowns):
        effect = found.hypothesis.effects[unknown.effect]
        if unknown.effect >= found.hypothesis.n_nuisances:
            continue
        key, name = effect.tolerance, nuisance_name(effect)
        scale, std = math.exp(vector[k]), math.exp(vector[k]) * math.sqrt(covariance[k, k])
        if key == "stiffness":
            unit = unit_of(robot, effect.target, "N*m/rad")
            size = float(nominal[effect.target])
        else:
            size, unit = {"damping_ratio": (ratio, "1"), "force": (force, "N")}.get(key, (1.0, "1"))
        result[name] = Value(scale * size, std * size, unit)
    return result


def with_solved(causes: Sequence[Cause], solved: Hypothesis) -> tuple[Cause, ...]:
    """The causes with the size of numbers that are not fitted but solved for in the residual.

    What noise adds to their power is taken out of it.

    Args:
        causes: as they are told without.
        solved: the hypothesis with these numbers in its effects.
    """
    told = []
    gains = {label: (fall, count) for label, fall, count in solved.drawn}
    sources = {(e.name, e.target): e for e in solved.effects if e.latent and e.latent.linear}
    for cause in causes:
        found = sources.get((cause.effect, cause.target))
        if found is not None and found.latent is not None:
            name = found.latent.spread
            seen, unit = found.values[name], cause.parameters[name].unit
            fall, count = gains.get(found.label, (math.inf, 0))
            size = seen * math.sqrt(max(1.0 - count / max(fall, 1e-300), 0.0))
            value = Value(size, seen / math.sqrt(max(fall, 1e-300)), unit)
            cause = replace(cause, parameters={**cause.parameters, name: value})
        told.append(cause)
    return tuple(told)
