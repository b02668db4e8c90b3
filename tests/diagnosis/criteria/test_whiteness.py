"""How far out of noise a power stands, against the distribution that it has."""

from types import SimpleNamespace

import numpy as np
import pytest
import trial
from scipy.stats import gamma, norm

import picchio
from picchio.diagnosis.percussion.conclude.verdict import not_quiet
from picchio.diagnosis.percussion.criteria.remainder import Remainder
from picchio.diagnosis.percussion.criteria.whiteness import (
    BAND_LIMIT,
    Evidence,
    Level,
    standard_deviations,
    whiteness_test,
)
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.fit.least_squares import fit
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.tolerance.linearise import settled

ARM = "fanuc_like_3dof"


@pytest.mark.parametrize("ordinates", [12, 30, 75, 1000])
@pytest.mark.parametrize("chance", [0.9, 0.5, 1e-3, norm.sf(BAND_LIMIT)])
def test_a_power_stands_out_as_often_as_a_normal_variable(ordinates, chance):
    """A periodogram's ordinates are exponential; so few of them have a long upper tail."""
    power = gamma.isf(chance, ordinates) / ordinates
    said = norm.sf(standard_deviations(power, 1.0 / np.sqrt(ordinates)))
    assert said == pytest.approx(chance, rel=0.25)


def test_what_stands_out_is_left_though_all_together_is_less_than_noise():
    """The noise was overstated: the sum of all would be below it whatever is wrong."""
    bands = Level("deflection", "14-26 Hz", 3.0, 20.0, 1000), Level("deflection", "26-46 Hz", 0.5,
                                                                    -9.0, 8000)  # fmt: skip
    evidence = Evidence(bands, (), 0.7)
    assert evidence.excess == pytest.approx(2000.0)
    found = SimpleNamespace(records=(), chi_square=7000.0, samples=10_000)
    assert Remainder.of(found, evidence).excess == pytest.approx(2000.0)
    # What may be chance does not stand out, and is in the sum of all.
    chance = Evidence((Level("deflection", "14-26 Hz", 1.1, 3.0, 1000),), (), 1.01)
    found = SimpleNamespace(records=(), chi_square=10_100.0, samples=10_000)
    assert Remainder.of(found, chance).excess == pytest.approx(100.0)


@pytest.mark.slow
def test_a_floor_that_shakes_before_the_blows_is_no_noise():
    case = {"robot": ARM, "kind": "outside", "snr": 40, "mismatch": 1.0, "draw": 90201}
    campaign, truth = trial.make(case, 1)
    assert truth["causes"][0]["effect"] == "floor_vibration"
    problem = Problem(picchio.load_robot(ARM), campaign)
    found = settled(problem, fit(problem, Hypothesis.baseline(problem.robot, campaign.tolerance)),
                    problem.records)  # fmt: skip
    evidence = whiteness_test(problem, found)
    # The deflections, below their noise, would hide two thirds of what the other sensor has.
    assert evidence.excess > 3.0 * (found.chi_square - found.samples) > 0.0
    assert evidence.overstated == ("deflection",)
    assert "deflection" in not_quiet(evidence.overstated)
