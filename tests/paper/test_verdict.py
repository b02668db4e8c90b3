"""Verdicts: each of the four can come out, and the input that decides is found."""

import numpy as np
import pytest

from picchio.paper.verdict import Verdict, across, best_split, decided, unknown
from picchio.paper.world import random_worlds


@pytest.fixture(scope="module")
def worlds():
    return random_worlds(60, seed=11)


def try_it(worlds, test, **options):
    return across(worlds, lambda w: (test(w), w.given.period), "t", "{base} {share} {worlds}")


def test_true_everywhere_false_everywhere(worlds):
    assert try_it(worlds, lambda w: True).verdict is Verdict.HOLDS
    assert try_it(worlds, lambda w: False).verdict is Verdict.FAILS


@pytest.mark.parametrize("at", [0.03, 0.05, 0.1])
def test_the_deciding_input_and_its_value_are_found(worlds, at):
    found = try_it(worlds, lambda w: w.given.period < at)
    assert found.verdict is Verdict.CONDITIONAL
    assert "period T is below" in found.condition
    value = float(found.condition.split("below ")[1].split(" ")[0])
    below = max(w.given.period for w in worlds if w.given.period < at)
    above = min(w.given.period for w in worlds if w.given.period >= at)
    assert below * 0.99 <= value <= above * 1.01
    assert "100 %" in found.condition


def test_a_choice_can_decide(worlds):
    words, right = best_split(worlds, [w.given.elbow == "up" for w in worlds])
    assert "elbow is up" in words
    assert right == 1.0


def test_two_inputs_together_are_not_blamed_on_one(worlds):
    found = try_it(worlds, lambda w: (w.given.period < 0.05) != (w.given.duty < 0.12))
    assert found.verdict is Verdict.CONDITIONAL
    assert "no single input decides" in found.condition


def test_a_handful_of_worlds_makes_no_rule(worlds):
    least = sorted(w.given.damping_ratio for w in worlds)[2]
    found = try_it(worlds, lambda w: w.given.damping_ratio <= least)
    assert "which is rare" in found.condition


def test_only_inputs_that_can_matter_are_named(worlds):
    true = np.array([w.given.period < 0.05 for w in worlds])
    words, right = best_split(worlds, true, among=["duty", "elbow"])
    assert "period" not in words
    assert right < 0.9


def test_facts_that_no_assumption_touches():
    assert decided(True, "t", "d").verdict is Verdict.HOLDS
    assert decided(False, "t", "d", condition="c").verdict is Verdict.FAILS
    found = decided(True, "t", "d", condition="it rains")
    assert (str(found.verdict), found.condition) == ("holds only if", "it rains")
    assert unknown("t", "d").verdict is Verdict.UNKNOWN
