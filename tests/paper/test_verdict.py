"""Verdicts: each of the four can come out, and the input that decides is found."""

import numpy as np
import pytest

from picchio.paper.claims import Verdict, best_split, judge, try_claim
from picchio.paper.world import random_worlds


@pytest.fixture(scope="module")
def worlds():
    return random_worlds(60, seed=11)


def try_it(worlds, test):
    return judge(worlds, [test(w) for w in worlds])


def test_true_everywhere_false_everywhere(worlds):
    assert try_it(worlds, lambda w: True) == (Verdict.HOLDS, "")
    assert try_it(worlds, lambda w: False) == (Verdict.FAILS, "")


@pytest.mark.parametrize("at", [0.03, 0.05, 0.1])
def test_the_deciding_input_and_its_value_are_found(worlds, at):
    verdict, condition = try_it(worlds, lambda w: w.given.period < at)
    assert verdict is Verdict.CONDITIONAL
    assert "period T is below" in condition
    value = float(condition.split("below ")[1].split(" ")[0])
    below = max(w.given.period for w in worlds if w.given.period < at)
    above = min(w.given.period for w in worlds if w.given.period >= at)
    assert below * 0.99 <= value <= above * 1.01
    assert "100 %" in condition


def test_a_choice_can_decide(worlds):
    words, right = best_split(worlds, [w.given.elbow == "up" for w in worlds])
    assert "elbow is up" in words
    assert right == 1.0


def test_two_inputs_together_are_not_blamed_on_one(worlds):
    verdict, condition = try_it(worlds, lambda w: (w.given.period < 0.05) != (w.given.duty < 0.12))
    assert verdict is Verdict.CONDITIONAL
    assert "no single input decides" in condition


def test_a_handful_of_worlds_makes_no_rule(worlds):
    least = sorted(w.given.damping_ratio for w in worlds)[2]
    _, condition = try_it(worlds, lambda w: w.given.damping_ratio <= least)
    assert "which is rare" in condition


def test_only_inputs_that_can_matter_are_named(worlds):
    true = np.array([w.given.period < 0.05 for w in worlds])
    words, right = best_split(worlds, true, among=["duty", "elbow"])
    assert "period" not in words
    assert right < 0.9


@pytest.mark.parametrize(
    ("changes", "verdict", "condition"),
    [
        ({"joint_limits_over_pi": (1.0, 0.5, 0.4)}, Verdict.CONDITIONAL, "atan2"),
        ({"masses": (80.0, 20.0, 40.0)}, Verdict.CONDITIONAL, "atan2"),
    ],
)
def test_a_condition_that_the_paper_does_not_state_is_told(altered, changes, verdict, condition):
    found = try_claim(altered(arm=changes, count=0), "phase")
    assert found.verdict is verdict
    assert condition in found.condition
    assert try_claim(altered(count=0), "hits").verdict is Verdict.UNKNOWN
