from __future__ import annotations

import math

import pytest

from picchio.core.results import plain
from picchio.fatigue.miner import peak_damage
from picchio.fatigue.sn.library import load_sn_curve
from picchio.robot.flexible_robot import FlexibleRobot
from picchio.robot.loading.load import load_robot
from picchio.studies.assessment.method_comparison import Term, compare_methods
from picchio.studies.assessment.run import assess
from picchio.studies.tasks import Task, task_from_dict

CURVE = load_sn_curve("42CrMo4-QT-keyed")


@pytest.fixture(scope="module")
def robot() -> FlexibleRobot:
    return load_robot("fanuc_like_3dof")


@pytest.fixture(scope="module")
def task(robot: FlexibleRobot) -> Task:
    return task_from_dict(
        {
            "hits_per_rivet": 12,
            "excitation": {"kind": "pulse_train", "force": 300.0, "period": 0.04, "width": 0.004},
            "operation": [
                {"name": "up", "direction": [0.0, 0.0, 1.0], "rivets": 2,
                 "poses": [[0.0, 0.5, -0.8], [0.3, 1.1, -1.0]]},
            ],
        },
        robot,
    )  # fmt: skip


@pytest.fixture(scope="module")
def terms(robot: FlexibleRobot, task: Task) -> dict[str, Term]:
    return {term.name: term for term in compare_methods(robot, task, CURVE)}


def test_every_term_is_there_and_the_factors_chain(terms: dict[str, Term]) -> None:
    assert list(terms) == [
        "paper", "transient", "counting", "curve", "endurance limit", "mean stress", "scatter",
    ]  # fmt: skip
    chain = terms["transient"].factor * terms["counting"].factor * terms["curve"].factor
    whole = terms["curve"].rivets_to_failure / terms["paper"].rivets_to_failure
    assert chain == pytest.approx(whole, rel=1e-12)
    for term in terms.values():
        if term.against is not None and math.isfinite(term.factor):
            before = terms[term.against].rivets_to_failure
            assert term.factor == pytest.approx(term.rivets_to_failure / before, rel=1e-12)


def test_ends_are_the_assessments(terms: dict[str, Term], robot: FlexibleRobot, task: Task) -> None:
    paper = assess(robot, task, method="paper")
    assert terms["paper"].rivets_to_failure == pytest.approx(paper.rivets_to_failure, rel=1e-12)
    assert terms["paper"].limiting_joint == paper.limiting_joint
    default = assess(robot, task, sn_curve=CURVE)
    assert terms["endurance limit"].rivets_to_failure == default.rivets_to_failure
    if math.isinf(default.rivets_to_failure):
        assert plain(terms["endurance limit"])["rivets_to_failure"] is None


def test_signs_that_physics_demands(terms: dict[str, Term]) -> None:
    # From rest the peaks are higher, and every hit still counts once: a shorter life. A mean
    # stress can only shorten it, half the specimens live longer than 97.5 % of them do.
    assert terms["transient"].factor < 1.0
    assert terms["mean stress"].factor < 1.0
    scatter = 10.0 ** (1.959964 * 0.04 * 8.0)
    assert terms["scatter"].factor == pytest.approx(scatter, rel=1e-6)


def test_transient_term_by_hand(terms: dict[str, Term], robot: FlexibleRobot, task: Task) -> None:
    curve = load_sn_curve("nie-2016", quiet=True)
    result = assess(robot, task, sn_curve=curve).operations[0]
    column = robot.flexible_names.index(terms["transient"].limiting_joint or "")
    peaks = [float(row[column]) for row in result.peak_shear_stress]
    # Two rivets at each of two poses: the mix's mean damage is that of the poses' mean.
    mean = sum(peak_damage(peak, 12, curve) for peak in peaks) / 2.0
    assert terms["transient"].rivets_to_failure == pytest.approx(1.0 / mean, rel=1e-9)
