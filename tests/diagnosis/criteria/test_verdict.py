"""What may be said of the causes that were found."""

import pytest

from picchio.diagnosis.percussion.conclude.verdict import verdict_of, why_not_claimed
from picchio.diagnosis.percussion.criteria.remainder import Remainder
from picchio.diagnosis.percussion.criteria.whiteness import BAND_LIMIT, Evidence, Level
from picchio.diagnosis.result import Cause, Value


def evidence(z):
    return Evidence((Level("deflection", "3-9 Hz", 1.0 + 0.1 * z, z),), (), 1.0)


NOISE, MORE = evidence(BAND_LIMIT - 0.1), evidence(BAND_LIMIT + 0.1)
COMMON = ("sensor_gain",)


def causes(*confidences):
    return [
        Cause("joint_stiffness", f"joint_{i}", confidence, {})
        for i, confidence in enumerate(confidences)
    ]


@pytest.mark.parametrize(
    ("confidences", "before", "after", "others", "explained", "common", "verdict"),
    [
        ((), NOISE, NOISE, False, None, (), "nothing-wrong"),
        ((), MORE, MORE, False, None, (), "unexplained"),
        ((0.6,), MORE, NOISE, False, 0.99, (), "named"),
        ((0.6,), MORE, NOISE, True, 0.99, (), "ambiguous"),
        ((0.999, 0.999), MORE, NOISE, False, 0.99, (), "named"),
        # Of several each must be needed beyond doubt.
        ((0.999, 0.999, 0.95), MORE, NOISE, False, 0.99, (), "unexplained"),
        ((0.999, 0.999), MORE, NOISE, False, 0.99, COMMON, "unexplained"),
        ((0.999, 0.999), MORE, MORE, False, 0.99, (), "partial"),
        ((0.999, 0.999), MORE, MORE, False, 0.95, (), "unexplained"),  # a stand-in does as much
        ((0.999, 0.95), MORE, MORE, False, 0.99, (), "unexplained"),
        ((0.999,), MORE, MORE, False, 0.5, (), "unexplained"),
        ((0.999,), MORE, MORE, True, 0.99, (), "unexplained"),
    ],
)
def test_verdict(confidences, before, after, others, explained, common, verdict):
    assert verdict_of(causes(*confidences), before, after, others, explained, common) == verdict


@pytest.mark.parametrize(
    ("before", "after", "explained", "verdict"),
    [
        (9e3, 2.0e3, 0.7, "partial"),  # 1.4 % of the signal, RMS: what a model may leave
        (2e4, 9e3, 0.7, "unexplained"),  # more than half
        (1e6, 4.0e4, 0.95, "unexplained"),  # 6 % of the signal: something else is there
        (1e7, 4.0e4, 0.99, "partial"),  # as much, but next to nothing of what is explained
    ],
)
def test_what_leaves_more_than_a_remainder_can_be_may_be_no_more_than_alike(
    before, after, explained, verdict
):
    left = Remainder(before, 1e7), Remainder(after, 1e7)
    found = verdict_of(causes(0.999), MORE, MORE, False, explained, (), left)
    assert found == verdict


def test_which_of_several_causes_is_doubted_is_said():
    why = why_not_claimed(causes(0.999, 0.95, 0.999), ())
    assert "3 causes together" in why
    assert "joint stiffness (joint_1, confidence 0.95) is not beyond doubt" in why
    assert "joint_0" not in why
    assert why_not_claimed(causes(0.999, 0.999), ()) == "" == why_not_claimed(causes(0.5), ())
    assert "all sensors" in why_not_claimed(causes(0.5, 0.5), COMMON)


def test_a_single_cause_that_may_as_well_do_nothing_is_not_named():
    def said(size, confidence, improbable):
        value = Value(size, 0.025, "")
        cause = [Cause("link_mass", "link_3", confidence, {"scale": value})]
        verdict = verdict_of(cause, MORE, NOISE, False, 0.99, (), improbable=improbable)
        return verdict, why_not_claimed(cause, (), improbable)

    assert said(0.9, 0.96, False) == ("named", "")
    verdict, why = said(0.98, 0.96, False)
    assert verdict == "unexplained" and "without it" in why
    # Nor one that is doubtful, where tolerances would have to be exceeded beside it.
    verdict, why = said(0.9, 0.96, True)
    assert verdict == "unexplained" and "tolerances" in why
    assert said(0.9, 0.995, True) == ("named", "")
