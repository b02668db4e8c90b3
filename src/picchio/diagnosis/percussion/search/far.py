"""Stiffness that is far from what is stated, found from nothing before anything else is sought.

Causes are added one by one, each from near the stated values. Where several joints are far off,
none of them alone helps, and a fit of all ends a cycle beside the truth: they are found together,
from the functions that the records are along a line in the Laplace plane (`stiffness.blows`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.diagnosis.attempt import attempt
from picchio.diagnosis.percussion.criteria.remainder import allowed
from picchio.diagnosis.percussion.data.problem import MeasuredRecord, Problem, signal_power
from picchio.diagnosis.percussion.fit.least_squares import Fit, fit_growing
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.search.exchange import prune
from picchio.diagnosis.percussion.search.state import Search
from picchio.diagnosis.percussion.tolerance.linearise import About, settled
from picchio.diagnosis.stiffness.blows import BlowRecord, Rough, rough
from picchio.model.effects.effect import Effect
from picchio.model.effects.structure.springs.joint_stiffness import JointStiffness
from picchio.model.effects.structure.springs.modal_damping import ModalDamping

# What the stated values leave of the signal's power, at least, for this to be worth while.
_MUCH = 0.02
# What springs and damping alone leave of the functions, at most, and of what is left without.
_LITTLE, _LESS = 0.35, 0.25
_HALF = 0.5  # likewise, while masses and places are taken as stated
# Logarithms: a joint that is off by this is found by itself, one that is off by more is not.
_OFF, _FAR = math.log(1.2), math.log(1.6)
_SURE = 0.15  # standard deviation of the logarithm


def start_far(search: Search) -> None:
    """Begin with all joints that are far from their stated stiffness, if that explains much.

    Args:
        search: its baseline fitted; `best` is replaced.
    """
    baseline = search.baseline
    left = (baseline.cost - baseline.samples) / signal_power(search.records)
    labels = {effect.label for effect in baseline.hypothesis.effects}
    if left < _MUCH or search.labels:
        return
    search.say("looking for stiffness that is far from what is stated")
    found = attempt("stiffness from nothing", partial(_off, search.problem, search.records))
    causes = [c for c in found or [] if c.label in labels & search.considered]
    if not causes:
        return
    before = About.of(search.problem)
    there = attempt("stiffness far off", partial(_fitted, search, causes))
    if there is None or there.cost > baseline.cost - search.least or not search.confirmed(there):
        before.restore(search.problem)
        return
    search.best = prune(search, there)


def _off(problem: Problem, records: Sequence[MeasuredRecord]) -> list[Effect]:
    """What is far from stated, if several joints are, or one by much; else nothing."""
    found = far_from_stated(problem, records)
    if found is None:
        return []
    causes: list[Effect] = [
        JointStiffness(name, scale=float(found.stiffness[k]))
        for k, name in enumerate(problem.robot.flexible_names)
        if _away(found)[k] > _OFF
    ]
    if abs(math.log(found.damping)) > _OFF:
        causes.append(ModalDamping("robot", scale=found.damping))
    return causes


def far_from_stated(problem: Problem, records: Sequence[MeasuredRecord]) -> Rough | None:
    """Springs and damping from nothing, if several joints are far from stated, or one by much.

    Args:
        problem: whose records they are.
        records: to look at.

    Returns:
        None where they are not, where springs and damping explain little, or of a saved model with
        effects, which is no robot of unknown stiffness.
    """
    if problem.robot.effect_tables:  # whose springs and masses are not the files'
        return None
    blown, tolerance = list(_blown(problem, records)), problem.campaign.tolerance
    found = rough(problem.robot, blown, workers=problem.workers)
    if found is None or not _is_far(found) or found.left > _HALF * found.before:
        return None
    if allowed(problem):
        found = rough(problem.robot, blown, tolerance, found)
    if found is None or found.left > min(_LITTLE, _LESS * found.before):
        return None
    return found if _is_far(found) else None


def _is_far(found: Rough) -> bool:
    away = _away(found)
    return bool((away > _OFF).sum() > 1 or away.max() > _FAR)


def _away(found: Rough) -> FloatArray:
    return np.abs(np.log(found.stiffness)) * (found.stiffness_std < _SURE)


def _blown(problem: Problem, records: Sequence[MeasuredRecord]) -> Iterator[BlowRecord]:
    for record in records:
        setup = record.setup
        direction = problem.campaign[record.name].direction
        if setup.steady or direction is None:
            continue
        rate = 1.0 / setup.samples.step
        channels = [
            (channel, record.values[channel.name], problem.noise[channel.name].at(rate).std)
            for channel in record.channels
        ]
        force = setup.struck(problem.model).force
        yield BlowRecord(
            record.name, setup.geometry.pose, direction, setup.samples.times, force, channels
        )


def _fitted(search: Search, causes: list[Effect]) -> Fit:
    start: Hypothesis = search.baseline.hypothesis
    for cause in causes:
        start = start.joined(cause)
    near = fit_growing(search.problem, start, search.records, iterations=8)
    return settled(search.problem, near, search.records)
