"""Simpler ways to name a cause, for comparison: what the method of `picchio diagnose` adds.

Both see the same data, the same noise, the same candidates and the same nuisances.
"""

from __future__ import annotations

import math

import numpy as np

from picchio.core.errors import InputError
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.fit.least_squares import fit
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.search.candidates import all_candidates, measure_scales
from picchio.diagnosis.percussion.search.screen import Projector, flat

MOST = 3
_SMALL = 1e-3


def _begin(robot, campaign, without):
    problem = Problem(robot, campaign)
    start = Hypothesis.baseline(robot, campaign.tolerance)
    found = fit(problem, start, iterations=8, with_jacobian=True)
    effects = found.hypothesis.effects
    scales = measure_scales(problem, effects, problem.predictions(effects))
    candidates = []
    for kind, target in all_candidates(problem, without):
        effect = kind(target)
        if effect.latent is None and not effect.discrete:
            trials = effect.trials(scales)
            if trials:
                candidates.append(kind(target, **trials[0]))
    return problem, found, candidates


def _shrunk(effect, share):
    """The effect at a small share of its size: a derivative where it has one."""
    values = {}
    for p in effect.parameters:
        value = effect.values[p.name]
        if p.neutral == 0.0 and math.isfinite(value):
            values[p.name] = share * value
        elif p.neutral == 1.0:
            values[p.name] = 1.0 + share * (value - 1.0)
        elif math.isinf(p.neutral) and p.name == "stiffness":
            values[p.name] = value / share
        else:
            values[p.name] = value
        values[p.name] = min(max(values[p.name], p.lower), p.upper)
    return effect.with_values(**values)


def score_test(robot, campaign, without=()):
    """Forward selection in a library of derivatives (sparse regression): no effect is refitted.

    Each candidate gives one column, its response at a thousandth of its size; the one that takes
    most out of the residual is chosen while BIC falls.
    """
    problem, found, candidates = _begin(robot, campaign, without)
    project = Projector(found)
    base = flat(found.residuals)
    columns, labels = [], []
    for effect in candidates:
        try:
            moved = problem.residuals(found.hypothesis.plus(_shrunk(effect, _SMALL)).effects)
        except InputError:
            continue
        column = project((flat(moved) - base)[:, None])[:, 0]
        size = np.linalg.norm(column)
        if size > 1e-9 and np.isfinite(size):
            columns.append(column / size)
            labels.append(effect.label)
    left, chosen = project(base), []
    columns = np.stack(columns, axis=1)
    while len(chosen) < MOST:
        gains = (columns.T @ left) ** 2
        gains[chosen] = 0.0
        best = int(np.argmax(gains))
        if gains[best] < 2.0 * math.log(left.size):
            break
        chosen.append(best)
        picked = columns[:, chosen]
        left = project(base) - picked @ np.linalg.lstsq(picked, project(base), rcond=None)[0]
    return {labels[i] for i in chosen}


def plain_bic(robot, campaign, without=()):
    """Least squares of every candidate on all the data from its typical size; the lowest BIC.

    No growing windows, no held-out poses, no test of what is left.
    """
    problem, found, candidates = _begin(robot, campaign, without)
    known, cost = found, found.cost
    chosen = []
    while len(chosen) < MOST:
        best = None
        for effect in candidates:
            if effect.label in chosen:
                continue
            try:
                # A fit that stays far above the best one so far is given up: it cannot win.
                rival = best[2].cost if best else math.inf
                start = known.hypothesis.plus(effect)
                tried = fit(problem, start, iterations=5, near=known, rival=rival)
            except InputError:
                continue
            bic = tried.cost + len(effect.parameters) * math.log(tried.samples)
            if best is None or bic < best[0]:
                best = bic, effect.label, tried
        if best is None or best[0] > cost:
            break
        chosen.append(best[1])
        cost = best[2].cost
        known = fit(problem, best[2].hypothesis, iterations=3, with_jacobian=True)
    return set(chosen)


METHODS = {"score-test": score_test, "plain-bic": plain_bic}
