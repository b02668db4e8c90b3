"""How far apart the paper's method and ours are on a task, one assumption at a time."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial

import numpy as np

from picchio.core import spoken
from picchio.core.arrays import FloatArray
from picchio.core.errors import held_back
from picchio.core.listing import Key, Listing
from picchio.fatigue.miner import life
from picchio.fatigue.sn.curve import SNCurve
from picchio.fatigue.sn.library import DEFAULT_SN_CURVE, PAPER_SN_CURVE, load_sn_curve
from picchio.model.model import ModelLike
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.studies.assessment.result import Assessment
from picchio.studies.assessment.run import assess
from picchio.studies.tasks import Task


@dataclass(frozen=True)
class Term:
    """The life after one more assumption is changed.

    Attributes:
        name: of the assumption.
        what: from what to what.
        rivets_to_failure: of the robot, its weakest shaft.
        limiting_joint: which that is; None where nothing fails.
        against: the term that differs in this assumption alone; None for the first.
        factor: this life over that one; inf or NaN where one is unlimited.
    """

    name: str
    what: str
    rivets_to_failure: float
    limiting_joint: str | None
    against: str | None
    factor: float


def terms_listing(terms: Iterable[Term]) -> Listing:
    """The terms as people read them.

    Args:
        terms: from the paper's method on.
    """
    title = "How far the paper's method is from the default one, an assumption at a time"
    columns: dict[str, Key] = {
        "term": "name",
        "rivets to failure": lambda t: spoken.count(t.rivets_to_failure),
        "first to fail": "limiting_joint",
        "times the life": lambda t: t.factor if math.isfinite(t.factor) else "",
        "of": lambda t: (t.against or "") if math.isfinite(t.factor) else "",
        "what changes": "what",
    }
    return Listing.of(title, terms, columns)


def compare_methods(robot: ModelLike, task: Task, sn_curve: SNCurve) -> tuple[Term, ...]:
    """From the paper's method to the default one, term by term.

    Endless lives can't be compared, so the default curve is first carried on below its endurance
    limit (Miner elementary); the limit itself, mean stress and scatter are then held against that.

    Args:
        robot: with shafts; or a model of it.
        task: what it does.
        sn_curve: the curve in place of the paper's, for all joints.

    Raises:
        InputError: as `assess`.
    """
    paper_curve = load_sn_curve(PAPER_SN_CURVE, quiet=True)
    told = partial(assess, robot, task, uncertainty=False)
    with held_back():  # what assess has to say, it says to whoever asked for the assessment itself
        paper = told(method="paper")
        counted = told(sn_curve=paper_curve)
        real = told(sn_curve=sn_curve, miner="elementary")
        limit = told(sn_curve=sn_curve, miner="original")
        corrected = told(sn_curve=sn_curve, miner="elementary", mean_stress="fkm")
        median = None
        if sn_curve.scatter and sn_curve.survival is not None:
            half = sn_curve.at_survival(0.5)
            median = told(sn_curve=half, miner="elementary")
    table = [
        ("paper", "the paper's method", _life(paper), None),
        ("transient", "peak of a rivet from rest, not of a steady state",
         _one_cycle_a_hit(counted, task, paper_curve), "paper"),
        ("counting", "cycles by rainflow, ring-down included, not one a hit",
         _life(counted), "transient"),
        ("curve", f"{sn_curve.name} without its endurance limit, not {PAPER_SN_CURVE}",
         _life(real), "counting"),
        ("endurance limit", "cycles below it do nothing (the default method)",
         _life(limit), "curve"),
        ("mean stress", "gravity and feed force by fkm, not none",
         _life(corrected), "curve"),
    ]  # fmt: skip
    if median is not None:
        table.append(
            ("scatter", f"half of the specimens survive, not {sn_curve.survival:g}",
             _life(median), "curve")
        )  # fmt: skip
    lives = {name: value for name, _, (value, _), _ in table}
    return tuple(
        Term(name, what, value, joint, against, _ratio(value, lives.get(against or "")))
        for name, what, (value, joint), against in table
    )


def method_terms(robot: FlexibleRobot, task: Task, found: Assessment) -> tuple[Term, ...]:
    """The terms by the default S-N curve; none where no shaft has a curve or nothing is damped.

    Args:
        robot: with shafts.
        task: what it does.
        found: the assessment of that.
    """
    known = any(joint.worn == "shaft" for joint in found.joints)
    damped = all(math.isfinite(check.rest_peak + check.steady_peak) for check in found.steady_state)
    return compare_methods(robot, task, load_sn_curve(DEFAULT_SN_CURVE)) if known and damped else ()


def _ratio(value: float, other: float | None) -> float:
    if other is None or (math.isinf(value) and math.isinf(other)):
        return math.nan
    return value / other


def _life(assessment: Assessment) -> tuple[float, str | None]:
    lives = {j.name: j.rivets_to_failure for j in assessment.joints if j.sn_curve}
    return _least(lives.items())


def _one_cycle_a_hit(
    assessment: Assessment, task: Task, curve: SNCurve
) -> tuple[float, str | None]:
    """The paper's counting on the peaks of the assessment's own response."""
    spent: FloatArray = np.zeros(len(assessment.joints))
    rivets = 0.0
    for result in assessment.operations:
        peaks = np.nan_to_num(np.asarray(result.peak_shear_stress))
        spent += result.rivets * result.hits_per_rivet * np.sum(
            1.0 / curve.cycles_to_failure(peaks), axis=0
        )  # fmt: skip
        rivets += result.rivets * len(peaks)
    return _least(
        (joint.name, life(float(damage) / rivets))
        for joint, damage in zip(assessment.joints, spent, strict=True)
        if joint.sn_curve
    )


def _least(lives: Iterable[tuple[str, float]]) -> tuple[float, str | None]:
    name, value = min(lives, key=lambda pair: pair[1], default=("", math.inf))
    return value, None if math.isinf(value) else name
