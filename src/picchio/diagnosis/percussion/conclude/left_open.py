"""What a fit leaves open of blows that nobody measured, for the interval of a life.

Beside the fitted values these are the numbers that are never exact: what the campaign shares as far
as the records tell it, and what is drawn anew for every burst. A heavier link with a stiffer joint
would have left the same records: both are moved together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin

from picchio.campaign.tables import Tolerance
from picchio.core.arrays import FloatArray
from picchio.diagnosis.life import Uncertain
from picchio.diagnosis.percussion.conclude.causes import reported_covariance
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.fit.least_squares import Fit, prior_precision
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.tolerance.nudges import Inexact, as_effects, inexact
from picchio.model.blows import Blows
from picchio.model.effects.effect import Effect, Where

# What the life depends on. Where the robot stands moves it by 0.2 % or less for most joints; by 4 %
# where a mode lies close to a multiple of the blows' rate.
_PLACES: tuple[Where, ...] = ("structure", "blows")


def fitted_spread(problem: Problem, whole: Fit) -> Uncertain:
    """How well all that a life depends on is known after a fit.

    Args:
        problem: linearised about the fit.
        whole: the fit to all records.
    """
    hypothesis, marginal = whole.hypothesis, problem.marginal
    covariance, tolerance = reported_covariance(whole), problem.campaign.tolerance
    # Of a force that was read nothing is learnt of the force of blows that are stated.
    stated = [_harder("force", tolerance.force)] if problem.recorded and tolerance.force else []
    if marginal is None:
        return _uncertain(hypothesis, covariance, stated)
    claimed = {effect.label for effect in hypothesis.effects}
    names = [record.name for record in whole.records]
    raw = problem.unmarginalised(hypothesis.effects, whole.records)
    where, spread = marginal.shared_estimate(raw, names, claimed=claimed)
    slopes = marginal.slopes[names[0]]
    shared = slopes.what[slopes.own :]
    kept = [k for k, one in enumerate(shared) if _counts(one) and one.means not in claimed]
    across = -(marginal.taken(_rows(hypothesis)) @ spread)[:, kept]
    together = np.block([[covariance, across], [across.T, spread[np.ix_(kept, kept)]]])
    numbers = [*(shared[k] for k in kept), *_anew(problem, tolerance), *stated]
    found = _uncertain(hypothesis, together, numbers)
    centre = found.centre.copy()
    centre[len(covariance) : len(covariance) + len(kept)] = where[kept]
    told = np.concatenate([as_stated(problem, whole).vector(), np.zeros(len(numbers))])
    return replace(found, centre=centre, told=told)


def as_stated(problem: Problem, whole: Fit) -> Hypothesis:
    """A fit with everything that is not exact where it is stated, as a study or a file has it.

    What the fitted values can make up for they do: beside masses that are 1 % too small as stated,
    springs that are 1 % softer than those fitted do as the records say.

    Args:
        problem: linearised about the fit.
        whole: the fit to all records.
    """
    hypothesis, marginal = whole.hypothesis, problem.marginal
    if marginal is None or not problem.sizes:
        return hypothesis
    name = problem.records[0].name
    size = problem.sizes[name][marginal.slopes[name].own :]
    vector = hypothesis.vector() + marginal.taken(_rows(hypothesis)) @ size
    unknowns = hypothesis.unknowns()
    return hypothesis.at(np.clip(vector, [u.lower for u in unknowns], [u.upper for u in unknowns]))


def _rows(hypothesis: Hypothesis) -> list[tuple[str, str]]:
    return [(hypothesis.effects[u.effect].label, u.name) for u in hypothesis.unknowns()]


def nominal_spread(problem: Problem) -> Uncertain:
    """How well all that a life depends on is known before anything was measured.

    Args:
        problem: robot and campaign.
    """
    tolerance = problem.campaign.tolerance
    hypothesis = Hypothesis.baseline(problem.robot, tolerance)
    precision = prior_precision(hypothesis)
    at = np.ix_(*[np.flatnonzero(precision.diagonal() > 0.0)] * 2)
    covariance = np.zeros_like(precision)
    covariance[at] = np.linalg.inv(precision[at])
    every = inexact(problem, problem.records[0], tolerance)
    shared = [one for one in every if one.once and _counts(one)]
    numbers = [*shared, *_anew(problem, tolerance)]
    return _uncertain(hypothesis, covariance, numbers)


def _counts(one: Inexact) -> bool:
    # How fast a blow rises, which is a number upwards alone, is 0.1 % of a joint's life, and 2 % at
    # the end of a wrist.
    return one.where in _PLACES and not one.one_way


def _anew(problem: Problem, sigma: Tolerance) -> list[Inexact]:
    """What is drawn for every burst: each mode's damping, the blows' direction and their force."""
    every = inexact(problem, problem.records[0], sigma, measured=False)
    found = [one for one in every if one.key == "damping_by_mode"]

    def turned(axis: FloatArray) -> Inexact:
        def turn(blows: Blows, size: float) -> Blows:
            return blows.change(direction=pin.exp3(size * sigma.direction * axis) @ blows.direction)

        return Inexact(f"direction.{'xyz'[int(axis.argmax())]}", "direction", False, "blows", turn)

    if sigma.direction > 0.0:
        found += [turned(axis) for axis in np.eye(3)]
    if sigma.blow_force > 0.0:
        # A few cycles make most of the damage: as if all blows were harder.
        found.append(_harder("blow_force", sigma.blow_force))
    return found


def _harder(key: str, sigma: float) -> Inexact:
    def harder(blows: Blows, size: float) -> Blows:
        return blows.change(height=blows.height * (1.0 + size * sigma))

    return Inexact(key, key, False, "blows", harder)


def _uncertain(
    hypothesis: Hypothesis, covariance: FloatArray, numbers: Sequence[Inexact]
) -> Uncertain:
    """A hypothesis's unknowns, then numbers that are not exact; those not given are alone."""
    unknowns = hypothesis.unknowns()
    lead, count = len(unknowns), len(unknowns) + len(numbers)
    whole = np.eye(count)
    whole[: len(covariance), : len(covariance)] = covariance

    def effects(vector: FloatArray) -> Sequence[Effect]:
        sizes = vector[lead:, None]
        moved = [(one, size) for one, size in zip(numbers, sizes, strict=True) if size[0]]
        return [*hypothesis.at(vector[:lead]).effects, *as_effects(moved)]

    free = np.full(len(numbers), np.inf)
    return Uncertain(
        effects,
        np.concatenate([hypothesis.vector(), np.zeros(len(numbers))]),
        whole,
        np.concatenate([[u.lower for u in unknowns], -free]),
        np.concatenate([[u.upper for u in unknowns], free]),
    )
