"""Percussion records by the one model of probability, on worlds that are a little wrong."""

import numpy as np
import pytest

import picchio
from picchio.diagnosis.evidence.numbers import Numbers
from picchio.diagnosis.percussion.data.problem import Problem
from picchio.diagnosis.percussion.fit.unknowns import Hypothesis
from picchio.diagnosis.percussion.likelihood.percussion import Data, Percussion
from picchio.diagnosis.percussion.posterior.search import Search
from picchio.diagnosis.percussion.search.candidates import measure_scales
from worlds import campaign as worlds

ARM = "fanuc_like_3dof"
pytestmark = pytest.mark.slow


def searched(causes, seed, records=18):
    """The verdict on a campaign with hidden causes, everything else off as tolerances allow."""
    campaign, _ = worlds.make(
        robot=ARM, seed=seed, causes=causes, sensors=("accelerometer.tool", "deflection"),
        records=records, snr_db=40.0, mismatch=1.0,
    )  # fmt: skip
    problem = Problem(picchio.load_robot(ARM), campaign)
    nominal = Hypothesis.nominal(problem).effects
    scales = measure_scales(problem, nominal, problem.predictions(nominal))
    search = Search(Data.of(problem), scales)
    return search.run(), search


def test_nothing_hidden_is_nothing_wrong():
    judged, _ = searched([], 11)
    assert judged.verdict == "nothing-wrong"
    assert judged.left < 0.005
    assert judged.odds < 3.0


@pytest.mark.minutes
@pytest.mark.parametrize(
    ("effect", "target", "values", "within"),
    [
        ("payload", "tool", {"mass": 4.0}, {"mass": 0.6}),
        ("pulse_width", "tool", {"scale": 0.8}, {"scale": 0.01}),
    ],
)
def test_a_single_cause_is_named_with_its_size(effect, target, values, within):
    judged, search = searched([(effect, target, values)], 21)
    assert judged.verdict == "named"
    (cause,) = search.causes_of(judged.fit)
    assert cause.label == f"{effect}:{target}"
    for name, value in values.items():
        assert cause.effect.values[name] == pytest.approx(value, abs=within[name])


def test_slopes_are_those_of_differences():
    campaign, _ = worlds.make(
        robot=ARM, seed=5, causes=[], sensors=("accelerometer.tool", "deflection"), records=3,
        snr_db=40.0, mismatch=1.0,
    )  # fmt: skip
    likelihood = Percussion(Data.of(Problem(picchio.load_robot(ARM), campaign)))
    at = likelihood.start()
    rng = np.random.default_rng(0)
    at = Numbers(  # where every number is a little off
        at.shared + 0.3 * likelihood.prior.std.shared * np.abs(rng.standard_normal(at.shared.size)),
        tuple(0.3 * rng.standard_normal(own.size) for own in at.groups),
        tuple(0.3 * rng.standard_normal(own.size) for own in at.records),
    )
    slopes = likelihood.linearised(at).records[0]
    own, group = at.records[0].size, at.groups[0].size
    compared = 0
    for number in range(own + group + at.shared.size):
        step = np.zeros(own + group + at.shared.size)
        step[number] = 1e-2 * (1.0 if number < own + group
                               else likelihood.prior.std.shared[number - own - group])  # fmt: skip
        both = []
        for sign in (-1.0, 1.0):
            moved = Numbers(
                at.shared + sign * step[own + group :],
                (at.groups[0] + sign * step[own : own + group], *at.groups[1:]),
                (at.records[0] + sign * step[:own], *at.records[1:]),
            )
            both.append(likelihood.residuals(moved)[0])
        difference = (both[0] - both[1]) / (2.0 * step[number])
        size = np.linalg.norm(difference) * step[number] / 1e-2
        if size < 1.0:  # less than the noise: what is of second order would be compared
            continue
        error = np.linalg.norm(slopes.column(number) - difference) * step[number] / 1e-2
        assert error < 0.05 * size, number
        compared += 1
    assert compared > 20
