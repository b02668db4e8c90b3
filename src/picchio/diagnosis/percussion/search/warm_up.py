"""Kernels and libraries loaded once, before processes are forked that would each load them."""

from __future__ import annotations

from collections.abc import Sequence

from picchio.core.errors import InputError
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.fit.workers import worker_count
from picchio.diagnosis.percussion.search.candidates import measure_scales
from picchio.model.effects.effect import Effect

_MOMENT = 0.06  # s


def warm_up(problem: Problem, candidates: Sequence[tuple[type[Effect], str]]) -> None:
    """Predict a moment of one record with every effect once, where there will be processes.

    Compiled kernels and libraries come with it. Processes are forked anew for every round of a
    search: what this one has not loaded each of them would load again.

    Args:
        problem: data and noise.
        candidates: effects and targets.
    """
    if worker_count(problem.workers) < 2:
        return
    nominal = Hypothesis.baseline(problem.robot, problem.campaign.tolerance)
    scales = measure_scales(problem, nominal.effects, problem.predictions(nominal.effects))
    first = dict(reversed(candidates))
    for kind, target in first.items():
        values = next(iter(kind(target).trials(scales)), {})
        try:
            effects = nominal.plus(kind(target, **values)).effects
            problem.own_residuals(effects, problem.records[:1], _MOMENT)
        except InputError:  # no model at this size
            continue
