"""Stiffness that is far from what is stated, found from nothing before anything else is sought.

Causes are added one by one, each from near the stated values. Where several joints are far off,
none of them alone helps, and a fit of all ends a cycle beside the truth. Nothing has turned by a
cycle right after the first blow: all are found together there, and followed on growing windows.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from picchio.core.arrays import FloatArray
from picchio.diagnosis.attempt import attempt
from picchio.diagnosis.evidence.estimate import FAILED, estimate, standardised
from picchio.diagnosis.evidence.estimate import Fit as Estimate
from picchio.diagnosis.evidence.verdict import LEFT, left_by
from picchio.diagnosis.percussion.data.problem import MeasuredRecord, Problem, signal_power
from picchio.diagnosis.percussion.fit.least_squares import Fit, fit_growing
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.likelihood.percussion import Data, Percussion
from picchio.diagnosis.percussion.search.exchange import prune
from picchio.diagnosis.percussion.search.state import Search
from picchio.diagnosis.percussion.tolerance.linearise import About, settled
from picchio.model.effects.effect import Effect
from picchio.model.effects.structure.springs.joint_stiffness import JointStiffness
from picchio.model.effects.structure.springs.modal_damping import ModalDamping

_WINDOWS = (0.02, 0.05, 0.1)
"""s, up to when records are looked at, one after the other."""
_STRAINED = 3.0
"""Standard deviations, root mean square: where masses and places are farther off, it is they."""
# What the stated values leave of the signal's power, at least, for this to be worth while.
_MUCH = 0.02
# Logarithms: a joint that is off by this is found by itself, one that is off by more is not.
_OFF, _FAR = math.log(1.2), math.log(1.6)
_SOUGHT = frozenset({JointStiffness.name, ModalDamping.name})
_SURE = 0.15  # standard deviation of the logarithm

_log = logging.getLogger("picchio.diagnosis")


@dataclass(frozen=True)
class Rough:
    """Springs and damping as records of blows have them.

    Attributes:
        stiffness: (n,) over the stated.
        stiffness_std: (n,) of the logarithms.
        damping: of all ratios, over the stated.
        left: residual over the signal, root mean square over the poses.
        before: the same with the stated values.
    """

    stiffness: FloatArray
    stiffness_std: FloatArray
    damping: float
    left: float
    before: float


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
    names = {record.name for record in records}
    chosen = [k for k, record in enumerate(problem.records) if record.name in names]
    every = Data.of(problem, _SOUGHT)
    found = rough(every.only([chosen[k] for k in every.only(chosen).one_a_pose]))
    if found is None or found.left > LEFT:
        return None
    return found if _is_far(found) else None


def rough(data: Data) -> Rough | None:
    """Springs and damping from nothing.

    Args:
        data: records, with springs and damping known within a factor.

    Returns:
        None where masses, poses and places would be absurdly far off.
    """
    found: Estimate | None = None
    try:
        for end in _WINDOWS:  # springs, damping and force, all else as stated
            light = Percussion(data, end=end, light=True)
            at = light.start(found.at, found.likelihood) if found else light.start()
            found = estimate(light, at, tolerance=1.0, renewals=6)
        assert found is not None
        stated = Percussion(data, end=_WINDOWS[-1])
        at = stated.start(found.at, found.likelihood)
        found = estimate(stated, at, tolerance=1.0)
        none = estimate(stated, stated.start(), steps=0)
    except FAILED as error:
        _log.debug("springs from nothing: %s", error)
        return None
    n = len(data.base)
    off = standardised(stated.prior, found.at).shared[n:]
    if off.size and off @ off > _STRAINED**2 * off.size:
        return None
    by_name = {each.label: k for k, each in enumerate(data.base)}
    springs = [by_name[JointStiffness(name).label]
               for name in data.problem.robot.flexible_names]  # fmt: skip
    return Rough(
        np.exp(found.at.shared[springs]), found.std[springs],
        math.exp(found.at.shared[by_name[ModalDamping("robot").label]]),
        left_by(found), left_by(none),
    )  # fmt: skip


def _is_far(found: Rough) -> bool:
    away = _away(found)
    return bool((away > _OFF).sum() > 1 or away.max() > _FAR)


def _away(found: Rough) -> FloatArray:
    return np.abs(np.log(found.stiffness)) * (found.stiffness_std < _SURE)


def _fitted(search: Search, causes: list[Effect]) -> Fit:
    start: Hypothesis = search.baseline.hypothesis
    for cause in causes:
        start = start.joined(cause)
    near = fit_growing(search.problem, start, search.records, iterations=8)
    return settled(search.problem, near, search.records)
